"""Where pages print figures, and the numbers on them that no figure answers for."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.conftest import ROOT
from tests.figures.ledger import Figure, Ledger

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


HOLE = re.compile(r"\{(\.\.\.|[A-Za-z][\w.-]*(?:#\w+)?(?::[^{}]+)?)\}")
NUMBER = r"[-−+]?\d+(?:[ ,]\d{3}(?!\d))*(?:\.\d+)?"


@dataclass(frozen=True)
class Found:
    """A template met on a page: where, and the text of each figure there with its place."""

    start: int
    end: int
    printed: tuple[tuple[str, int, int], ...]


def holes(template: str) -> list[str]:
    """The figures of a template, as they are written in it, without what stands for anything."""
    return [hole for hole in HOLE.findall(template) if hole != "..."]


def figure_of(hole: str) -> str:
    """The figure's id: `zema.weak` of `zema.weak#count` and of `zema.weak:.2f`."""
    return re.split("[#:]", hole)[0]


def rendered(hole: str, figures: Mapping[str, Figure]) -> str:
    """What should stand in the place of a hole; raises KeyError for an unknown figure."""
    name, _, spec = hole.partition(":")
    name, _, part = name.partition("#")
    value = getattr(figures[name], part or "value")
    if spec.endswith("%"):
        return f"{100 * value:{spec[:-1]}f}"
    return f"{value:{spec or 'g'}}"


def find(template: str, text: str, figures: Mapping[str, Figure] | None = None) -> Found | None:
    """Where a text holds the template: with these figures; without, with any numbers."""
    match = re.search(_pattern(template, figures), text, re.DOTALL)
    if match is None:
        return None
    spans = [(hole, *match.span(k + 1)) for k, hole in enumerate(holes(template))]
    return Found(match.start(), match.end(), tuple(spans))


REST = r"(?:(?!\n\s*\n|\n\s*(?:[-*|#]|\d+\.)).)*"
"""The rest of a paragraph, a list item or a row."""


def everywhere(template: str, text: str) -> list[tuple[int, int]]:
    """Start and end of every passage that the template fits, with any numbers."""
    return [match.span() for match in re.finditer(_pattern(template, None), text, re.DOTALL)]


def _pattern(template: str, figures: Mapping[str, Figure] | None) -> str:
    parts = HOLE.split(template)
    pattern = []
    for k, part in enumerate(parts):
        if k % 2 == 0:
            pattern.append(r"\s+".join(re.escape(word) for word in re.split(r"\s+", part)))
        elif part == "...":
            pattern.append(r"(?:(?!\n\s*\n).)*?" if k + 2 < len(parts) or parts[-1] else REST)
        else:
            pattern.append(f"({re.escape(rendered(part, figures)) if figures else NUMBER})")
    return "".join(pattern)


def replaced(template: str, text: str, figures: Mapping[str, Figure]) -> str:
    """The text with today's figures in the place of the numbers that stand there."""
    found = find(template, text)
    if found is None:
        raise ValueError(f"nowhere on its page: {template}")
    for hole, start, end in reversed(found.printed):
        text = text[:start] + rendered(hole, figures) + text[end:]
    return text
