"""Which files of the project each measuring command uses, noted when it was run."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath

from tests.conftest import ROOT

FILE = Path(__file__).parent / "sources.json"
HOOK = Path(__file__).parent / "traced"
"""Folder of the `sitecustomize` that notes them."""

TOPS = {"rulec": "rulec", "rulec_runtime": "runtime/rulec_runtime", "tests": "tests"}
ALL_OF = "kb"
"""Of the knowledge base all files count in a folder of which one was read, also new ones: `*`."""


@functools.cache
def read_sources(file: Path = FILE) -> Mapping[str, tuple[str, ...]]:
    """Paths by command, from the top of the project; of those that were run since this is noted."""
    if not file.exists():
        return {}
    kept = json.loads(file.read_text(encoding="utf-8"))
    return {
        command: tuple(f"{folder}/{name}" for folder, names in part.items() for name in names)
        for command, part in kept.items()
    }


def write_sources(command: str, paths: Iterable[str], file: Path = FILE) -> None:
    """Put those of one command in place of what was noted of it: a line for each folder."""
    known = {**read_sources(file), command: tuple(sorted(paths))}
    text = []
    for name, found in sorted(known.items()):
        folders: dict[str, list[str]] = {}
        for path in found:
            folder, _, leaf = path.rpartition("/")
            folders.setdefault(folder, []).append(leaf)
        lines = [f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(folders.items())]
        text.append(f"{json.dumps(name)}: {{\n" + ",\n".join(lines) + "\n}")
    file.write_text("{\n" + ",\n".join(text) + "\n}\n", encoding="utf-8")
    read_sources.cache_clear()


def environment(note: Path, root: Path = ROOT) -> dict[str, str]:
    """Variables that make each Python process below note what it uses."""
    return {"RULEC_TRACED": str(note), "RULEC_TRACED_ROOT": str(root)}


def used(note: Path, root: Path = ROOT) -> tuple[str, ...]:
    """Paths of what was noted, sorted."""
    found: set[str] = set()
    for line in note.read_text(encoding="utf-8").splitlines():
        kind, _, name = line.partition(" ")
        path = name if kind == "read" else _path_of(name, root)
        if path is None or not (root / path).is_file():
            continue
        listed = PurePosixPath(path).parts[0] == ALL_OF
        found.add(f"{PurePosixPath(path).parent}/*" if listed else path)
    return tuple(sorted(found))


def files_of(path: str, root: Path = ROOT) -> list[str]:
    """The file, or, where a path ends with `*`, all files of that folder."""
    folder, _, leaf = path.rpartition("/")
    if leaf != "*":
        return [path]
    return sorted(f"{folder}/{f.name}" for f in (root / folder).glob("*") if f.is_file())


def _path_of(module: str, root: Path) -> str | None:
    """File of a module of the project; None if there is none, as of a name that was tried."""
    top, *rest = module.split(".")
    place = "/".join([TOPS[top], *rest])
    for path in (f"{place}/__init__.py", f"{place}.py"):
        if (root / path).is_file():
            return path
    return None
