"""docs/figures.md: every figure with its interval, its command and whether it is fresh."""

from __future__ import annotations

import re

from tests.conftest import ROOT
from tests.figures.content import is_stale
from tests.figures.ledger import Account, Figure, Ledger

PAGE = ROOT / "docs" / "figures.md"
HEAD = """# Figures

Every figure that the README and these pages print stands in [figures.yaml](figures.yaml), with what
measured it. This page is made from it by `python -m tests.figures mark`.

- `make figures` measures again and prints what it found in the ledger, in the pages and here. Slow
  figures take hours; `python -m tests.figures measure --only ID` takes some.
- `make test` fails when a page prints something else than the ledger, when it prints a number that
  the ledger does not know, and when a small measurement contradicts a printed figure.
- *stale*: code or data that the measuring command used changed after the measurement; the figure
  may still be true. Comments, docstrings and files that a command does not use make no figure
  stale, once it was measured with its files noted. *sealed*: opened once, cannot be measured again.
  *quoted*: published.

An interval is that of the count (Clopper and Pearson, 95 %) or a tolerance; the ledger says which.

| figure | value | interval | measured by | at | state |
|---|---|---|---|---|---|
"""

ACCOUNTS = """
Accounts are sentences about one run, read from it by hand. They hold for its commit alone.

| account | page | run | at | passages |
|---|---|---|---|---|
"""


def state_of(figure: Figure, ledger: Ledger) -> str:
    """`fresh`, `stale`, `sealed` or `quoted`."""
    if figure.kind != "measured":
        return figure.kind
    return "stale" if is_stale(figure, ledger) else "fresh"


def overview(ledger: Ledger) -> str:
    """The page's text."""
    rows = [_row(f, state_of(f, ledger)) for f in ledger.figures.values()]
    return HEAD + "".join(rows) + ACCOUNTS + "".join(map(_account, ledger.accounts))


def without_states(text: str) -> str:
    """The page without its last column, which every change of the code may change."""
    return re.sub(r"\| (?:fresh|stale) \|$", "| |", text, flags=re.MULTILINE)


def _row(figure: Figure, state: str) -> str:
    value = f"{figure.count} of {figure.of}" if figure.count is not None else f"{figure.value:g}"
    unit = "" if figure.unit == "1" else f" {figure.unit}"
    command = f"`{figure.command}`" if figure.command else figure.because
    at = " ".join(part for part in (figure.date, figure.commit) if part)
    interval = f"{figure.low:g} to {figure.high:g}"
    return f"| {figure.id} | {value}{unit} | {interval} | {command} | {at} | {state} |\n"


def _account(account: Account) -> str:
    page = account.file.removeprefix("docs/")
    link = f"[{page}]({page if page != account.file else '../' + page})"
    at = f"{account.date} {account.commit}"
    return f"| {account.id} | {link} | `{account.command}` | {at} | {len(account.texts)} |\n"
