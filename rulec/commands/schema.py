"""`rulec schema`: write the schemas of all file kinds, and the line that leads editors to them."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.open_file import bytes_of
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_data, write_text

from rulec.commands.editor_line import MARK, SCHEMA, line, schemas, target
from rulec.knowledge.layers import yaml_files_in
from rulec.language.document import read_document
from rulec.language.schema import kind_of
from rulec.limits import MAX_FILE_BYTES

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
