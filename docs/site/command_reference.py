"""The page of all commands: what `--help` of each says."""

from __future__ import annotations

import contextlib
import io
import os
import re
from collections.abc import Callable, Iterator, Sequence

from rulec_runtime.cli import main as station

from rulec.cli import main as whole

WIDTH = "100"
"""Columns of a help text on the page."""

Main = Callable[[Sequence[str]], int]


def command_page() -> str:
    """Markdown with a chapter per program and a section per command."""
    os.environ["COLUMNS"] = WIDTH
    parts = [
        "# Commands",
        "What `--help` says. Words in capitals are explained by the pages of tasks.",
    ]
    for name, main in (("rulec", whole), ("rulec-runtime", station)):
        parts.append(f"## {name}")
        for words, text in _texts(main, ()):
            title = " ".join((name, *words))
            parts += [f"### {title}"] * bool(words) + [f"```text\n{text.rstrip()}\n```"]
    return "\n\n".join(parts) + "\n"


def _texts(main: Main, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], str]]:
    """Help of a command and of the commands below it."""
    text = _help(main, words)
    yield words, text
    _, found, below = text.partition("positional arguments:")
    below = below.partition("options:")[0] if found else ""
    if re.search(r"^  (COMMAND|FORMAT)$", below, re.MULTILINE):
        for name in re.findall(r"^    (\S+)", below, re.MULTILINE):
            yield from _texts(main, (*words, name))


def _help(main: Main, words: tuple[str, ...]) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        main([*words, "--help"])
    return out.getvalue()
