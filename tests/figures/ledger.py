"""docs/figures.yaml as values, and what is wrong with it."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.conftest import ROOT, plain_yaml
from tests.figures.share import Share

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
        wrong += [f"{measurement.id}: {told}" for told in _mistakes(measurement, ledger)]
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
            place: Share(**value) if isinstance(value, Mapping) else float(value)
            for place, value in entry.get("values", {}).items()
        },
        prints=_pairs(entry["prints"]),
    )


def _pairs(form: Mapping[str, list[str]]) -> Pairs:
    return tuple((page, text) for page, texts in form.items() for text in texts)
