"""docs/figures.yaml as values, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.conftest import ROOT, plain_yaml

FILE = ROOT / "docs" / "figures.yaml"
KINDS = ("measured", "sealed", "quoted")
"""Measured by a command; opened once and never again; taken from a publication."""
COSTS = ("quick", "slow")


@dataclass(frozen=True)
class Quick:
    """A smaller measurement of the same figure, for every test run."""

    command: str
    key: str


@dataclass(frozen=True)
class Figure:
    """A number that is printed somewhere.

    Attributes
    ----------
    value, low, high : float; the interval is what a new measurement may give
    because : where the interval comes from
    count, of : int or None; for shares
    command, key : what measures it, and the place of the value in its JSON; no key: read by hand
    depends : names of the sets of files that the value depends on
    needs : a folder of the shared recordings, or empty
    commit, date, content : state in which it was measured; content is a hash of what it depends on
    """

    id: str
    kind: str
    value: float
    low: float
    high: float
    because: str
    unit: str
    command: str
    key: str
    depends: tuple[str, ...]
    needs: str
    cost: str
    commit: str
    date: str
    content: str
    count: int | None
    of: int | None
    quick: Quick | None


@dataclass(frozen=True)
class Place:
    """A line or a part of it; `{id}` stands for a figure, `{...}` for anything."""

    file: str
    text: str


@dataclass(frozen=True)
class Account:
    """Sentences that tell of one run, read from it by hand: they stand for its commit alone."""

    id: str
    command: str
    commit: str
    date: str
    file: str
    texts: tuple[str, ...]


@dataclass(frozen=True)
class Ledger:
    """All figures, where they are printed, accounts, and the numbers that claim nothing."""

    files: Mapping[str, tuple[str, ...]]
    figures: Mapping[str, Figure]
    places: tuple[Place, ...]
    accounts: tuple[Account, ...]
    no_claim: Mapping[str, tuple[str, ...]]
    no_claim_pages: Mapping[str, str]


def read_ledger(file: Path = FILE) -> Ledger:
    """Read and check; raises ValueError with all that is wrong."""
    form = plain_yaml(file)
    figures = [_figure(entry) for entry in form["figures"]]
    places = tuple(Place(page, text) for page, texts in form["places"].items() for text in texts)
    ledger = Ledger(
        {name: tuple(globs) for name, globs in form["files"].items()},
        {f.id: f for f in figures},
        places,
        tuple(_account(entry) for entry in form["accounts"]),
        {page: tuple(texts) for page, texts in form["no_claim"].items()},
        form["no_claim_pages"],
    )
    twice = [f.id for f in figures if sum(g.id == f.id for g in figures) > 1]
    wrong = [f"'{name}' stands twice" for name in dict.fromkeys(twice)] + mistakes(ledger)
    if wrong:
        raise ValueError(f"{file}: " + "; ".join(wrong))
    return ledger


def mistakes(ledger: Ledger) -> list[str]:
    """What contradicts itself."""
    wrong = []
    for f in ledger.figures.values():
        wrong += [f"{f.id}: kind '{f.kind}', not one of {KINDS}"] * (f.kind not in KINDS)
        wrong += [f"{f.id}: cost '{f.cost}', not one of {COSTS}"] * (f.cost not in COSTS)
        strangers = ", ".join(sorted(set(f.depends) - set(ledger.files)))
        wrong += [f"{f.id}: no set of files '{strangers}'"] * bool(strangers)
        if not f.low <= f.value <= f.high:
            wrong.append(f"{f.id}: {f.value} lies outside of {f.low} to {f.high}")
        if f.kind == "measured" and not (f.command and f.commit and f.date and f.depends):
            wrong.append(f"{f.id}: measured, but without command, commit, date or depends")
        if f.of is not None and f.count is not None and abs(f.count / f.of - f.value) > 1e-3:
            wrong.append(f"{f.id}: {f.count} of {f.of} is not {f.value}")
    return wrong


def _figure(entry: Mapping[str, Any]) -> Figure:
    low, high = entry["interval"]
    quick = entry.get("quick")
    depends = entry.get("depends", [])
    return Figure(
        id=entry["id"],
        kind=entry.get("kind", "measured"),
        value=float(entry["value"]),
        low=float(low),
        high=float(high),
        because=entry["because"],
        unit=entry["unit"],
        command=entry.get("command", ""),
        key=entry.get("key", ""),
        depends=tuple(depends if isinstance(depends, list) else [depends]),
        needs=entry.get("needs", ""),
        cost=entry.get("cost", "slow"),
        commit=str(entry.get("commit", "")),
        date=str(entry.get("date", "")),
        content=str(entry.get("content", "")),
        count=entry.get("count"),
        of=entry.get("of"),
        quick=Quick(quick["command"], quick["key"]) if quick else None,
    )


def _account(entry: Mapping[str, Any]) -> Account:
    return Account(
        entry["id"],
        entry["command"],
        str(entry["commit"]),
        str(entry["date"]),
        entry["file"],
        tuple(entry["texts"]),
    )
