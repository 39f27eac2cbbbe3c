"""The ledger and the pages with new figures; all else in them stays as it is."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from tests.conftest import ROOT
from tests.figures.ledger import FILE, Figure, Ledger
from tests.figures.pages import figure_of, holes, replaced


def write_figures(figures: Iterable[Figure], file: Path = FILE) -> None:
    """Put new values into the lines of the ledger; comments and order stay."""
    text = file.read_text(encoding="utf-8")
    for figure in figures:
        text = _with(figure, text)
    file.write_text(text, encoding="utf-8")


def write_places(ledger: Ledger, changed: Iterable[str], root: Path = ROOT) -> list[str]:
    """Print new figures where they are printed; returns the pages that changed."""
    wanted = set(changed)
    texts: dict[str, str] = {}
    for place in ledger.places:
        if wanted.isdisjoint(figure_of(hole) for hole in holes(place.text)):
            continue
        text = texts.get(place.file) or (root / place.file).read_text(encoding="utf-8")
        texts[place.file] = replaced(place.text, text, ledger.figures)
    written = []
    for file, text in texts.items():
        if text != (root / file).read_text(encoding="utf-8"):
            (root / file).write_text(text, encoding="utf-8")
            written.append(file)
    return written


def _with(figure: Figure, text: str) -> str:
    """The ledger's text with one figure's fields replaced."""
    begin = re.search(rf"^  - id: {re.escape(figure.id)}$", text, re.MULTILINE)
    if begin is None:
        raise ValueError(f"no figure {figure.id}")
    after = re.compile(r"^(?:  - id: |\S)", re.MULTILINE).search(text, begin.end())
    end = after.start() if after else len(text)
    block = text[begin.start() : end]
    for name, value in _fields(figure).items():
        line = f"    {name}: {value}"
        block, hits = re.subn(rf"^    {name}:.*$", line, block, count=1, flags=re.MULTILINE)
        if not hits:
            block = block.rstrip("\n") + f"\n{line}\n"
    return text[: begin.start()] + block + text[end:]


def _fields(figure: Figure) -> Mapping[str, str]:
    fields = {
        "value": f"{figure.value:.6g}",
        "interval": f"[{figure.low:.6g}, {figure.high:.6g}]",
        "commit": f'"{figure.commit}"',
        "date": figure.date,
        "content": f'"{figure.content}"',
    }
    if figure.count is not None:
        fields |= {"count": str(figure.count), "of": str(figure.of)}
    return fields
