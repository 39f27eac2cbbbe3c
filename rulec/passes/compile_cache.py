"""Results kept from an earlier start, valid while no source of the plant has changed.

Nothing here imports a pass at its top, as a compiler that need not run need not be loaded.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rulec_runtime import limits as limits_of_runtime
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import RulesetRefused, parse_ruleset
from rulec_runtime.output.json_file import parse_json
from rulec_runtime.output.open_file import begin_of, is_near
from rulec_runtime.output.private_folder import cached, keep

from rulec.knowledge.layers import KB, layers_of, plant_file, shipped
from rulec.language.diagnostics import Place, Refused
from rulec.limits import MAX_FILE_BYTES

if TYPE_CHECKING:
    from rulec.knowledge.sources import Sources
    from rulec.passes.types import Compilation


def ruleset_of_plant(
    plant: Path, make: Callable[[], Ruleset] | None = None, now: str | None = None
) -> Ruleset:
    """The ruleset of a plant (folder or file), compiled only if something has changed.

    `make` replaces the compiler if the caller has compiled the plant anyway; `now` is its
    `known_print`, if known. Raises `Refused` with all mistakes of the first bad pass.
    """

    def compiled() -> Ruleset:
        from rulec.passes.pipeline import compile_plant

        return compile_plant(plant)

    found: Ruleset = _saved(plant, "ruleset", now, make or compiled, Ruleset.to_json, parse_ruleset)
    return found


def saved_of_plant(plant: Path, kind: str, make: Callable[[], Any]) -> Any:
    """JSON data that depend only on a plant: those of an earlier start, else made by `make`."""
    return _saved(plant, kind, None, make, json.dumps, lambda data: data)


def _saved(
    plant: Path,
    kind: str,
    now: str | None,
    make: Callable[[], Any],
    write: Callable[[Any], str],
    read: Callable[[Any], Any],
) -> Any:
    """A result of an earlier start, else a new one, which is kept for later ones."""
    now = now or saved_print(plant)
    found = None if now is None else cached(f"{now}.{kind}")
    if found is not None:
        try:
            return read(parse_json(found.decode("utf-8")))
        except (ValueError, RulesetRefused):
            pass  # damaged, or written by another version
    before, made = _print(plant), make()
    # If a source has changed meanwhile, either version may have been read.
    if before is not None and before == _print(plant):
        now, names = before
        keep(f"{print_of_text(plant_file(plant))}.names", json.dumps(names).encode())
        keep(f"{now}.{kind}", write(made).encode("utf-8"))
    return made


def saved_print(plant: Path) -> str | None:
    """Hash of all sources of a plant; None if its file has changed since it was last read."""
    file = plant_file(plant)
    try:
        names = cached(f"{print_of_text(file)}.names")
        return None if names is None else print_of_all(file, json.loads(names))
    except (OSError, ValueError, Refused):
        return None


def _print(plant: Path) -> tuple[str, dict[str, list[str]]] | None:
    """Hash of all sources of a plant, and the files that it names; None if it has mistakes."""
    from rulec.language.read_yaml import read_document

    file = plant_file(plant)
    try:
        document, _ = read_document(file)
        if document is None or not isinstance(document.data, dict):
            return None
        names = named_in(document.data)
        return print_of_all(file, names), names
    except (OSError, ValueError, Refused):
        return None


# One hash of everything a ruleset is made from, without parsing any of it. Equal hashes mean equal
# bytes in all files that matter, and the same tool. Which folders and files belong to a plant is
# known from the first time its file was read.

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


def print_of_all(plant: Path, named: Mapping[str, list[str]]) -> str:
    """Hash of a plant file, of all files that it names, and of all its knowledge.

    Raises OSError or `Refused` if something is missing.
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


@dataclass(frozen=True)
class OpenedPlant:
    """Documents of a plant and what is compiled from them; each result may raise `Refused`.

    `now` is the hash of all its sources, if it was known when they were read.
    """

    path: Path
    sources: Sources
    now: str | None

    @cached_property
    def ruleset(self) -> Ruleset:
        """The ruleset of an earlier start, or a new one if something has changed."""
        return ruleset_of_plant(self.path, lambda: self._compiled.ruleset, self.now)

    @cached_property
    def models(self) -> Compilation:
        """A compilation with the ruleset and all fields up to `types`."""
        ruleset = self.ruleset
        if "_compiled" in vars(self):
            return self._compiled
        from rulec.passes.pipeline import run_passes
        from rulec.passes.types import Compilation

        models = Compilation(path=self.path, sources=self.sources, ruleset=ruleset)
        return run_passes(models, "types")

    @cached_property
    def _compiled(self) -> Compilation:
        from rulec.passes.pipeline import run_passes
        from rulec.passes.types import Compilation

        return run_passes(Compilation(path=self.path, sources=self.sources))


def open_plant(path: Path, effects: bool = False) -> OpenedPlant:
    """Read a plant (folder or file); raises `Refused` with all mistakes of form.

    Only a comparison with recordings needs `effects`.
    """
    from rulec.knowledge.read import read_plant  # loads a reader of YAML

    now = saved_print(path)
    return OpenedPlant(path, read_plant(path, effects), now)
