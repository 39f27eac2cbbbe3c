"""The line by which an editor finds the schema of a YAML file, and the schemas themselves."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from rulec.knowledge.layers import KB, shipped

SCHEMA = "schema"
MARK = "yaml-language-server:"


def schemas(folder: Path) -> Iterator[tuple[Path, str]]:
    """Paths below a folder, and texts, of all schemas."""
    for file in sorted((shipped(KB) / SCHEMA).glob("*.json")):
        yield folder / SCHEMA / file.name, file.read_text(encoding="utf-8")


def schema_near(file: Path, kind: str) -> Path | None:
    """The nearest schema of a kind: in `schema` or `kb/schema` of a folder above the file."""
    for folder in Path(os.path.abspath(file)).parents:
        for place in (folder, folder / KB):
            schema = place / SCHEMA / f"{kind}.schema.json"
            if schema.is_file():
                return schema
    return None


def target(file: Path, folder: Path, kind: str) -> str:
    """Path of the schema of a kind in a folder, relative to a file."""
    schema = os.path.abspath(folder / SCHEMA / f"{kind}.schema.json")
    return Path(os.path.relpath(schema, os.path.abspath(file.parent))).as_posix()


def line(to: str) -> str:
    """The first line of a file, which leads to a schema."""
    return f"# {MARK} $schema={to}"
