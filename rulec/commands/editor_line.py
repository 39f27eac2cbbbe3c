"""The line by which an editor finds the schema of a YAML file, and the schemas themselves."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from rulec.knowledge.layers import KB, shipped

SCHEMA = "schema"
MARK = "yaml-language-server:"


def schemas(folder: Path) -> Iterator[tuple[Path, str]]:
    """Files and texts of all schemas, as they come to stand in a folder."""
    for file in sorted((shipped(KB) / SCHEMA).glob("*.json")):
        yield folder / SCHEMA / file.name, file.read_text(encoding="utf-8")


def schema_near(file: Path, kind: str) -> Path | None:
    """The nearest schema of a kind, in a folder `schema` or `kb/schema` upwards."""
    for folder in Path(os.path.abspath(file)).parents:
        for place in (folder, folder / KB):
            schema = place / SCHEMA / _name(kind)
            if schema.is_file():
                return schema
    return None


def target(file: Path, folder: Path, kind: str) -> str:
    """Path of a schema in a folder, as a file names it."""
    schema = os.path.abspath(folder / SCHEMA / _name(kind))
    return Path(os.path.relpath(schema, os.path.abspath(file.parent))).as_posix()


def line(to: str) -> str:
    """The line, which stands at the top of a file."""
    return f"# {MARK} $schema={to}"


def _name(kind: str) -> str:
    return f"{kind}.schema.json"
