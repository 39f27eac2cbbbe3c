"""Destinations of results: stories on the terminal, files and JSON in a file or standard output.

`-` instead of a file is standard output; stories then go to standard error.
"""

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console

from rulec_runtime.output.progress import Progress
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import (
    machine_text,
    say_aside,
    styled,
    terminal,
    write_document,
    write_machine_text,
)
from rulec_runtime.output.write_file import write_text

STANDARD_OUTPUT = "-"

FILES = ("output", "json", "report", "trace", "series", "csv")
"""Options that name an output file."""


def console(options: argparse.Namespace) -> Console:
    """Console of a command: standard output, or standard error if a file goes to standard output;
    prints nothing with `--quiet`."""
    return terminal(aside=bool(_to_standard_output(options)), quiet=is_quiet(options))


def is_quiet(options: argparse.Namespace) -> bool:
    """Whether to print only results and mistakes."""
    return bool(getattr(options, "quiet", False))


def note_aside(options: argparse.Namespace, text: str) -> None:
    """Print a note on standard error, unless `--quiet`."""
    if not is_quiet(options):
        say_aside(text)


def progress_of(options: argparse.Namespace, doing: str) -> Progress:
    """Progress of a command; raises `Misused` before it begins if an output cannot be written."""
    check_outputs(options)
    return Progress(f"rulec {options.command}", doing, quiet=is_quiet(options))


def check_outputs(options: argparse.Namespace) -> None:
    """Raises `Misused` before a long calculation if an output cannot be written."""
    several = _to_standard_output(options)
    if len(several) > 1:
        raise Misused(f"only one of {' and '.join(several)} can go to standard output")
    lacking = without_folder(options, *(name for name in FILES if name != "output"))
    if lacking is not None:
        raise Misused(lacking)


def without_folder(options: argparse.Namespace, *names: str) -> str | None:
    """The message for an output file whose folder does not exist; None if all exist."""
    for name in names:
        target = getattr(options, name, None)
        if target not in (None, STANDARD_OUTPUT) and not Path(target).parent.is_dir():
            return f"--{name} {target}: there is no folder '{Path(target).parent}'; make it first"
    return None


def _to_standard_output(options: argparse.Namespace) -> list[str]:
    return [f"--{n}" for n in FILES if getattr(options, n, None) == STANDARD_OUTPUT]


def write_to(target: str, text: str) -> None:
    """Write a text to a file or to standard output."""
    if target == STANDARD_OUTPUT:
        write_document(text)
    else:
        write_text(Path(target), text)


def show_files(out: Console, files: Mapping[str, str | Path | None]) -> None:
    """Name the files that were written, by what they hold."""
    for what, file in files.items():
        if file is not None:
            out.print(styled("[dim]{}: {}[/]", what, file))


def write_json(options: argparse.Namespace, data: Any) -> None:
    """Write JSON to the destination of `--json`, if that is given."""
    target = getattr(options, "json", None)
    if target is None:
        return
    text = json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    if target == STANDARD_OUTPUT:
        write_machine_text(text)
    else:
        write_text(Path(target), machine_text(text))
