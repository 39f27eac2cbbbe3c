"""`rulec schema`: write the schemas of all file kinds, and the line that leads editors to them."""

import argparse
import os
import re
from collections.abc import Iterator
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.open_file import bytes_of
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_data, write_text

from rulec.knowledge.layers import KB, shipped, yaml_files_in
from rulec.language.read_yaml import read_document
from rulec.language.schema import kind_of
from rulec.limits import MAX_FILE_BYTES

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


_LINE = re.compile(rf"^#\s*{MARK}\s*\$schema=(\S+)\s*$", re.MULTILINE)


def run(options: argparse.Namespace) -> int:
    """Write the schemas below a folder, and the line into every file there that leads to none."""
    folder, out = Path(options.folder), console(options)
    files = dict(schemas(folder))
    (folder / SCHEMA).mkdir(parents=True, exist_ok=True)
    for file, text in files.items():
        write_text(file, text)
    out.print(styled("[green]✓[/] {}: {} schemas", folder / SCHEMA, len(files)), soft_wrap=True)
    for file in yaml_files_in(folder):
        document, _ = read_document(file)
        kind = None if document is None else kind_of(document)
        if kind is None:
            continue
        text = bytes_of(file, MAX_FILE_BYTES).decode("utf-8-sig")
        found = _LINE.search(text)
        # A schema at another address is the author's business.
        if found and (":" in found[1] or (file.parent / found[1]).is_file()):
            continue
        to = line(target(file, folder, kind))
        ending = "\r\n" if "\r\n" in text else "\n"
        changed = text.replace(found[0].strip(), to, 1) if found else f"{to}{ending}{text}"
        write_data(file, changed.encode())
        out.print(styled("[green]✓[/] {}: {}", file, to), soft_wrap=True)
    return 0
