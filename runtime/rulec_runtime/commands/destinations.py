"""Where results go: stories to the terminal, machine forms to a file or standard output."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from rich.console import Console

from rulec_runtime.output.terminal import machine_text, terminal, write_machine_text
from rulec_runtime.output.write_file import write_text

FILES = ("json", "output", "trace", "series")
"""Options that name a file to write, where ``-`` is standard output."""


def console(options: argparse.Namespace) -> Console:
    """Console of a command: standard output, or standard error while a result goes to the
    former."""
    return terminal(aside=any(getattr(options, name, None) == "-" for name in FILES))


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
        write_machine_text(text)
    else:
        write_text(Path(target), machine_text(text))
