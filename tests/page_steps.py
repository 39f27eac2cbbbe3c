"""Pages of the documentation, read: files that the reader writes, commands and what they print."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(
    r'^## (?P<heading>[^\n]*)$|^```(?P<kind>\w+)(?: title="(?P<title>.*?)")?\n(?P<text>.*?)^```',
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Written:
    """A file that the reader writes as the page has it."""

    heading: str
    file: Path
    text: str


@dataclass(frozen=True)
class Typed:
    """A command, and lines that stand in what it prints."""

    heading: str
    command: str
    shown: tuple[str, ...]


def steps_of(page: Path) -> Iterator[Written | Typed]:
    """What the reader of a page does, in order, each with the heading that it stands below."""
    heading = ""
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        if block["heading"] is not None:
            heading = block["heading"]
        if block["title"]:
            yield Written(heading, Path(block["title"]), block["text"])
        if block["kind"] == "console":
            for part in re.split(r"^\$ ", block["text"], flags=re.MULTILINE)[1:]:
                command, *shown = part.rstrip("\n").split("\n")
                yield Typed(heading, command, tuple(filter(str.strip, shown)))
