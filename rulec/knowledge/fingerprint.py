"""One hash of everything a ruleset is made from, without parsing any of it.

Equal hashes mean equal bytes in all files that matter, and the same tool. Which folders and files
belong to a plant is known from the first time its file was read.
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

from rulec.knowledge.layers import KB, layers_of, shipped, yaml_files_in
from rulec.language.diagnostics import Place
from rulec.limits import MAX_FILE_BYTES

_LIBRARIES = re.compile(r"(numpy|scipy|sympy|networkx|pyyaml|jsonschema)-.*", re.IGNORECASE)
"""Folders of installed distributions, with their versions, that may change the last digit of a
ruleset, or what is refused."""

_NAMING = ("kb", "columns", "calibration", "adjacency")
"""Keys of a plant file that name folders and files, one or a list of them."""


def named_in(plant: Mapping[str, Any]) -> dict[str, list[str]]:
    """Folders and files that a plant file names, by key."""
    found = {}
    for key in _NAMING:
        value = plant.get(key, [])
        names = [value] if isinstance(value, str) else value
        found[key] = [name for name in names if isinstance(name, str)]
    return found


def print_of_text(plant: Path) -> str:
    """Hash of the plant file alone and of the tool; raises OSError if it cannot be read."""
    return _hash((_tool(), os.path.realpath(plant), begin_of(plant, MAX_FILE_BYTES + 1)))


def print_of_all(plant: Path, named: Mapping[str, list[str]], whole: bool) -> str:
    """Hash of a plant file, of all files that it names, and of all its knowledge.

    `whole` adds all other YAML beside it, which `rulec check` reads. Raises OSError or `Refused` if
    something is missing.
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
    """The real path of a folder, then the name and the bytes of each file."""
    yield os.path.realpath(folder)
    for file in files:
        yield os.path.relpath(file, folder)
        yield begin_of(file, MAX_FILE_BYTES + 1)


@cache
def _tool() -> str:
    """Hash of the compiler: its files by size and date, its libraries, and whether checks are on.

    Files are not read: development changes their dates, and an update their sizes or versions.
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
    except OSError:  # not every entry of the search path is a folder that exists
        return []


def _hash(parts: Iterable[str | bytes]) -> str:
    """SHA-256 of parts, each preceded by its length, so that none runs into the next."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode("utf-8", "surrogateescape") if isinstance(part, str) else part
        total.update(b"%d:" % len(data))
        total.update(data)
    return total.hexdigest()
