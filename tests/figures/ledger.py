"""docs/figures.yaml as values, and what is wrong with it."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.conftest import ROOT, plain_yaml


@dataclass(frozen=True)
class Share:
    """`count` out of `of`."""

    count: int
    of: int

    @property
    def value(self) -> float:
        """The share; not a number of nothing."""
        return self.count / self.of if self.of else float("nan")

    def form(self) -> dict[str, Any]:
        """Machine form; null for a share of nothing."""
        value = round(self.value, 6) if self.of else None
        return {"count": self.count, "of": self.of, "value": value}


FILE = ROOT / "docs" / "figures.yaml"
MEASURED = "measured"
KINDS = (MEASURED, "read by hand", "opened once", "quoted")
Pairs = tuple[tuple[str, str], ...]
HOLE = re.compile(r"\{([^{}]+)\}")
ANYTHING = "..."


@dataclass(frozen=True)
class Measurement:
    """An entry of docs/figures.yaml, whose head explains the fields."""

    id: str
    kind: str
    command: str
    date: str
    commit: str
    content: str
    depends: tuple[str, ...]
    needs: str
    values: Mapping[str, float | Share]
    prints: Pairs


@dataclass(frozen=True)
class Ledger:
    """Rooms as globs, measurements by id, and the numbers and pages that claim nothing."""

    rooms: Mapping[str, tuple[str, ...]]
    measurements: Mapping[str, Measurement]
    no_claim: Pairs
    no_claim_pages: Mapping[str, str]


def read_ledger(file: Path = FILE) -> Ledger:
    """Read and check; raises ValueError with all that is wrong."""
    form = plain_yaml(file)
    entries = [_measurement(entry) for entry in form["measurements"]]
    ledger = Ledger(
        {room: tuple(globs) for room, globs in form["rooms"].items()},
        {m.id: m for m in entries},
        _pairs(form["no_claim"]),
        form["no_claim_pages"],
    )
    wrong = [f"'{n}' stands twice" for n, k in Counter(m.id for m in entries).items() if k > 1]
    for measurement in entries:
        wrong += [f"{measurement.id}: {mistake}" for mistake in _mistakes(measurement, ledger)]
    if wrong:
        raise ValueError(f"{file}: " + "; ".join(wrong))
    return ledger


def value_of(hole: str) -> str:
    """The value's place: `a/b` of `a/b#count` and of `a/b:.2f`."""
    return re.split("[#:]", hole)[0]


def holes(template: str) -> list[str]:
    """The values of a template, as they are written in it, without what stands for anything."""
    return [hole for hole in HOLE.findall(template) if hole != ANYTHING]


def _mistakes(m: Measurement, ledger: Ledger) -> Iterator[str]:
    """What contradicts itself."""
    if m.kind not in KINDS:
        yield f"kind '{m.kind}', not one of {KINDS}"
    if m.kind != "quoted" and not (m.date and m.commit):
        yield "without date or commit"
    if strangers := sorted(set(m.depends) - set(ledger.rooms)):
        yield f"no room {', '.join(strangers)}"
    if bool(m.content) != bool(m.depends) or bool(m.values) != (m.kind == MEASURED):
        yield "content belongs to depends, and values to what a command measures"
    shown = {value_of(h) for _, text in m.prints for h in holes(text)}
    if unlike := sorted(shown ^ set(m.values)):
        yield f"printed without a value, or a value that no page prints: {', '.join(unlike)}"


def _measurement(entry: Mapping[str, Any]) -> Measurement:
    return Measurement(
        id=entry["id"],
        kind=entry.get("kind", MEASURED),
        command=entry["command"],
        date=str(entry.get("date", "")),
        commit=entry.get("commit", ""),
        content=entry.get("content", ""),
        depends=tuple(entry.get("depends", ())),
        needs=entry.get("needs", ""),
        values={
            path: Share(**value) if isinstance(value, Mapping) else float(value)
            for path, value in entry.get("values", {}).items()
        },
        prints=_pairs(entry["prints"]),
    )


def _pairs(form: Mapping[str, list[str]]) -> Pairs:
    return tuple((page, text) for page, texts in form.items() for text in texts)


DIGITS = re.compile(r"\d[\d.,]*")
NO_PROSE = re.compile(
    r"^```.*?^```[^\n]*$"  # shown by a command, and checked by tests/test_docs.py; or code
    r"|`[^`\n]*`"  # names, options
    r"|\]\([^)\n]*\)"  # targets of links
    r"|<!--.*?-->"
    r"|^#+ [^\n]*$"  # headings
    r"|^\s*\d+\. "  # numbers of a list
    r"|(?:Eqs?\.|section|Table|Figures?|[Cc]laims?|ISO|IEC|OPC|CAEX|NAMUR|NE|GUM|VG|HLP|KB|Python|"
    r"exit code(?: is)?|exits with)"
    r" ?\d[\d.:-]*(?:(?:, | and | to |–)\d[\d.]*)*"
    r"|\b[A-Z]\w+\*? (?:19|20)\d\d\b(?:, \d+\(\d+\), \d+)?"  # publications
    r"|\b95\s%\s(?:bounds|interval)|\(95\s%\)"  # of all that the tool tells
    r"|\b\w*[A-Za-z_]\d[\w.]*",  # names with a digit in them
    re.MULTILINE | re.DOTALL,
)
"""What is no prose, or refers to something: its digits are no figures."""

NUMBER = r"[-−+]?\d+(?:[ ,]\d{3}(?!\d))*(?:\.\d+)?"
REST = r"(?:(?!\n\s*\n|\n\s*(?:[-*|#]|\d+\.)).)*"
"""The rest of a paragraph, a list item or a row."""

Values = Mapping[str, float | Share]


def misprints(ledger: Ledger, root: Path = ROOT) -> list[str]:
    """Where something else is printed than the ledger says, and texts that are gone."""
    wrong = []
    for file, template, values in _texts(ledger):
        text = (root / file).read_text(encoding="utf-8")
        if _found(template, text, values):
            continue
        found = _found(template, text)
        if found is None:
            wrong.append(f"{file}: nowhere found: {template}")
            continue
        for hole, printed in zip(holes(template), found.groups(), strict=True):
            says = rendered(hole, values)
            if printed != says:
                wrong.append(f"{file}: {hole}: prints {printed}, measured {says}")
    return wrong


def unclaimed(ledger: Ledger, root: Path = ROOT) -> Iterator[str]:
    """File, line and text of numbers that are in no text of the ledger."""
    files = ["README.md", *(f"docs/{p.name}" for p in sorted((root / "docs").glob("*.md")))]
    for file in (f for f in files if f not in ledger.no_claim_pages):
        text = (root / file).read_text(encoding="utf-8")
        spans = [match.span() for match in NO_PROSE.finditer(text)]
        for template in (template for page, template, _ in _texts(ledger) if page == file):
            spans += [fit.span() for fit in re.finditer(_pattern(template), text, re.DOTALL)]
        for match in DIGITS.finditer(text):
            if not any(start <= match.start() < end for start, end in spans):
                line = text.count("\n", 0, match.start())
                around = text.splitlines()[line].strip()[:90]
                yield f"{file}:{line + 1}: {match.group()} in '{around}'"


def rendered(hole: str, values: Values) -> str:
    """What should stand in the place of a hole, as `a/b`, `a/b#count`, `a/b:.2f` or `a/b:.0%`."""
    name, _, spec = hole.partition(":")
    part = name.partition("#")[2] or "value"
    value = values[value_of(hole)]
    number = getattr(value, part) if isinstance(value, Share) else value
    if spec.endswith("%"):
        return f"{100 * number:{spec[:-1]}f}"
    return f"{number:{spec or 'g'}}"


def replaced(template: str, text: str, values: Values) -> str:
    """A page's text with these values in the place of the numbers that stand there."""
    found = _found(template, text)
    if found is None:
        raise ValueError(f"nowhere on its page: {template}")
    for k, hole in reversed([*enumerate(holes(template), start=1)]):
        text = text[: found.start(k)] + rendered(hole, values) + text[found.end(k) :]
    return text


def _texts(ledger: Ledger) -> Iterator[tuple[str, str, Values]]:
    """Everything that answers for a number: page, template, values of its holes."""
    for measurement in ledger.measurements.values():
        yield from ((file, text, measurement.values) for file, text in measurement.prints)
    yield from ((file, text, {}) for file, text in ledger.no_claim)


def _found(template: str, text: str, values: Values | None = None) -> re.Match[str] | None:
    """Where a text holds the template: with these values; without, with any numbers."""
    return re.search(_pattern(template, values), text, re.DOTALL)


def _pattern(template: str, values: Values | None = None) -> str:
    parts = HOLE.split(template)
    pattern = []
    for k, part in enumerate(parts):
        if k % 2 == 0:
            pattern.append(r"\s+".join(re.escape(word) for word in re.split(r"\s+", part)))
        elif part == ANYTHING:
            pattern.append(r"(?:(?!\n\s*\n).)*?" if k + 2 < len(parts) or parts[-1] else REST)
        else:
            pattern.append(f"({NUMBER if values is None else re.escape(rendered(part, values))})")
    return "".join(pattern)
