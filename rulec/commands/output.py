"""Where results go: stories to the terminal, machine forms to a file or standard output."""

from __future__ import annotations

import argparse
import gzip
import io
import json
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TextIO

from rich.console import Console


def console(options: argparse.Namespace) -> Console:
    """Console of a command: standard output, or standard error while JSON goes to the former."""
    return Console(stderr=getattr(options, "json", None) == "-", highlight=False)


def without_folder(options: argparse.Namespace, *names: str) -> str | None:
    """What to say of an output file that cannot be written, before long work is done for it."""
    for name in names:
        target = getattr(options, name)
        if target not in (None, "-") and not Path(target).parent.is_dir():
            return f"--{name} {target}: there is no such folder"
    return None


def write_json(options: argparse.Namespace, data: Any) -> None:
    """Write the machine form where `--json` says; nothing if it was not asked for."""
    target = getattr(options, "json", None)
    if target is None:
        return
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    if target == "-":
        sys.stdout.write(text)
    else:
        write_text(Path(target), text)


def write_text(path: Path, text: str) -> None:
    """Write a file as a whole or not at all: a killed process leaves no half file."""
    with written(path) as file:
        file.write(text)


@contextmanager
def written(path: Path) -> Iterator[TextIO]:
    """A file to write to, packed if its name ends with .gz; it is there when all is written."""
    part = path.with_name(path.name + ".part")
    try:
        with ExitStack() as stack:
            file: Any = stack.enter_context(part.open("wb"))
            if path.name.lower().endswith(".gz"):
                # No date and no name in it: the same content gives the same bytes.
                file = stack.enter_context(gzip.GzipFile("", "wb", fileobj=file, mtime=0))
            yield stack.enter_context(io.TextIOWrapper(file, encoding="utf-8", newline="\n"))
        part.replace(path)
    except OSError as error:
        error.filename = str(path)  # the user asked for this one
        raise
