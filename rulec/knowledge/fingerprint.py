"""What a ruleset is made from, as one hash, without parsing any of it.

Two equal hashes mean equal bytes in all files that count, and the same tool. A plant file says
which folders and files belong to it; what it says is known from its first reading.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from rulec_runtime import limits as limits_of_runtime
from rulec_runtime.output.open_file import begin_of, is_near

from rulec.knowledge.layers import KB, PLANT, layers_of, shipped, yaml_files_in
from rulec.language.diagnostics import Place
from rulec.limits import MAX_FILE_BYTES

_LIBRARIES = re.compile(r"(numpy|scipy|sympy|networkx|pyyaml|jsonschema)-.*", re.IGNORECASE)
"""Installed distributions whose version may change the last digit of a ruleset, or what is
refused; their folders are called by name and version."""

_NAMING = ("kb", "columns", "calibration", "adjacency")
"""Keys of a plant file that name folders and files, one or a list of them."""


def named_in(plant: Mapping[str, Any]) -> dict[str, list[str]]:
    """Folders and files that the data of a plant file name, by key."""
    found = {}
    for key in _NAMING:
        value = plant.get(key, [])
        names = [value] if isinstance(value, str) else value
        found[key] = [name for name in names if isinstance(name, str)]
    return found


def file_of(plant: Path) -> Path:
    """The plant file, where a folder may be given."""
    return plant / PLANT if plant.is_dir() else plant


def print_of_text(plant: Path) -> str:
    """Hash of the plant file alone and of the tool; raises OSError where it cannot be read."""
    return _hash((_tool(), os.path.realpath(plant), _bytes_of(plant)))


def print_of_all(plant: Path, named: Mapping[str, list[str]], whole: bool = False) -> str:
    """Hash of a plant file, of all that it names and all knowledge around it.

    With `whole` also of all other YAML beside it, which `rulec check` reads.

    Raises OSError or `Refused` where something is not there.
    """
    folder = plant.parent
    parts: list[str | bytes] = [print_of_text(plant)]
    for layer in layers_of(folder, [(name, Place("")) for name in named["kb"]]):
        parts += (layer.name, layer.kind, layer.version)
        parts += _contents(layer.folder, layer.files)
    beside = [folder / name for key in _NAMING[1:] for name in named[key]]
    if not all(is_near(file, folder) for file in beside):
        raise OSError("a file of the plant is none that may be read")
    parts += _contents(folder, beside)
    if whole:
        parts += _contents(folder, yaml_files_in(folder))
    return _hash(parts)


def _contents(folder: Path, files: Iterable[Path]) -> Iterator[str | bytes]:
    """Real place of a folder, and of each file name and bytes."""
    yield os.path.realpath(folder)
    for file in files:
        yield os.path.relpath(file, folder)
        yield _bytes_of(file)


def _bytes_of(file: Path) -> bytes:
    """As much of a file as is ever read of it."""
    return begin_of(file, MAX_FILE_BYTES + 1)


@cache
def _tool() -> str:
    """Hash of what compiles: its files by size and date, libraries, and whether it checks itself.

    Files are not read: somebody who develops changes their dates, and an update the rest.
    """
    folders = (Path(__file__).parents[1], Path(limits_of_runtime.__file__).parent)
    files = [found for folder in folders for found in _code_below(str(folder))]
    files += _code_below(str(shipped(KB) / "schema"))
    versions = sorted(name for folder in sys.path for name in _libraries_in(folder))
    checks = bool(os.environ.get("RULEC_CHECKS"))
    return _hash((json.dumps([sys.version, versions, sorted(files), checks]),))


def _code_below(folder: str) -> Iterator[tuple[str, int, int]]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith((".py", ".schema.json")):
                found = entry.stat()
                yield entry.path, found.st_size, found.st_mtime_ns
            elif entry.is_dir() and entry.name not in ("__pycache__", KB, "plants"):
                yield from _code_below(entry.path)


def _libraries_in(folder: str) -> list[str]:
    try:
        return [name for name in os.listdir(folder or ".") if _LIBRARIES.fullmatch(name)]
    except OSError:  # not every entry of the search path is there, or is a folder
        return []


def _hash(parts: Iterable[str | bytes]) -> str:
    """SHA-256 of parts, each with its length, so that none runs into the next."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode("utf-8", "surrogateescape") if isinstance(part, str) else part
        total.update(b"%d:" % len(data))
        total.update(data)
    return total.hexdigest()
