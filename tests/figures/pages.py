"""Numbers on the pages that no figure of the ledger answers for."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.conftest import ROOT
from tests.figures.ledger import Ledger
from tests.figures.templates import everywhere, find, holes, rendered

DIGITS = re.compile(r"\d[\d.,]*")
NO_PROSE = re.compile(
    r"^```.*?^```[^\n]*$"  # shown by a command, and checked by tests/test_docs.py; or code
    r"|`[^`\n]*`"  # names, options
    r"|\]\([^)\n]*\)"  # targets of links
    r"|<!--.*?-->"
    r"|^#+ [^\n]*$"  # headings
    r"|^\s*\d+\. "  # numbers of a list
    r"|(?:Eqs?\.|section|Table|Figures?|[Cc]laims?|ISO|NE|GUM|ISO VG|HLP|KB)"
    r" ?\d[\d.:]*(?:(?:, | and | to |–)\d[\d.]*)*"
    r"|\b\w*[A-Za-z_]\d[\w.]*",  # names with a digit in them
    re.MULTILINE | re.DOTALL,
)
"""What is no prose, or refers to something: its digits are no figures."""


@dataclass(frozen=True)
class Unclaimed:
    """A number without a figure, and where it stands."""

    file: str
    line: int
    number: str
    around: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.number} in '{self.around}'"


def pages(ledger: Ledger, root: Path = ROOT) -> list[str]:
    """Every page of the project, but those that make no claims."""
    files = ["README.md", *(f"docs/{p.name}" for p in sorted((root / "docs").glob("*.md")))]
    return [file for file in files if file not in ledger.no_claim_pages]


def unclaimed(ledger: Ledger, root: Path = ROOT) -> Iterator[Unclaimed]:
    """Numbers that stand in no place of the ledger, and are not listed there as no claim."""
    for file in pages(ledger, root):
        text = (root / file).read_text(encoding="utf-8")
        spans = [match.span() for match in NO_PROSE.finditer(text)]
        for template in _texts(ledger, file):
            spans += everywhere(template, text)
        for match in DIGITS.finditer(text):
            if not any(start <= match.start() < end for start, end in spans):
                line = text.count("\n", 0, match.start())
                around = text.splitlines()[line].strip()[:90]
                yield Unclaimed(file, line + 1, match.group(), around)


def misprints(ledger: Ledger, root: Path = ROOT) -> list[str]:
    """Places where something else is printed than the ledger says, or that are gone."""
    wrong = []
    for place in ledger.places:
        text = (root / place.file).read_text(encoding="utf-8")
        if find(place.text, text, ledger.figures):
            continue
        found = find(place.text, text)
        if found is None:
            wrong.append(f"{place.file}: nowhere found: {place.text}")
            continue
        for hole, start, end in found.printed:
            says = rendered(hole, ledger.figures)
            if text[start:end] != says:
                wrong.append(f"{place.file}: {hole}: prints {text[start:end]}, measured {says}")
    for file, templates in _told(ledger).items():
        text = (root / file).read_text(encoding="utf-8")
        wrong += [f"{file}: nowhere found: {t}" for t in templates if not find(t, text)]
    return wrong


def _texts(ledger: Ledger, file: str) -> list[str]:
    """Everything that answers for a number of a page."""
    printed = [place.text for place in ledger.places if place.file == file and holes(place.text)]
    return printed + _told(ledger).get(file, [])


def _told(ledger: Ledger) -> dict[str, list[str]]:
    """Accounts, and what claims nothing, by page."""
    texts = {file: list(some) for file, some in ledger.no_claim.items()}
    for account in ledger.accounts:
        texts.setdefault(account.file, []).extend(account.texts)
    return texts
