"""Where results go: stories to the terminal, machine forms to a file or standard output."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

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
    part = path.with_name(path.name + ".part")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError as error:
        error.filename = str(path)  # the user asked for this one
        raise
