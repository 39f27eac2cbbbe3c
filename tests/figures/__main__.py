"""The ledger of figures: `python -m tests.figures check|list|measure`.

`check`: pages print what the ledger says, and no number that nobody answers for. `list`: all
figures, stale ones first. `measure`: run the commands again, rewrite ledger and pages.
"""

from __future__ import annotations

import argparse
import datetime
import subprocess
import sys
import time
from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from tests.conftest import ROOT, recordings_folder
from tests.figures.change import write_figures, write_places
from tests.figures.commands import output_of, picked, updated
from tests.figures.content import content_of, state_of
from tests.figures.ledger import Figure, Ledger, read_ledger
from tests.figures.pages import misprints, unclaimed
from tests.figures.sources import write_sources

OUT = Console(highlight=False, soft_wrap=True, markup=False)


def main() -> int:
    """Do what is asked; 1 if something is wrong."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.figures",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("verb", choices=("check", "list", "measure"))
    parser.add_argument("--only", nargs="*", default=(), metavar="ID", help="or its first part")
    parser.add_argument("--stale", action="store_true", help="measure: only what is stale")
    options = parser.parse_args()
    ledger = read_ledger()
    match options.verb:
        case "check":
            return check(ledger)
        case "list":
            show(ledger)
        case "measure":
            return measure(ledger, _chosen(ledger, options.only, options.stale))
    return 0


def check(ledger: Ledger) -> int:
    """Pages against the ledger."""
    wrong = [*misprints(ledger), *map(str, unclaimed(ledger))]
    for line in wrong:
        OUT.print(line)
    OUT.print(f"{len(ledger.figures)} figures, {len(wrong)} mistakes; {_count_stale(ledger)}")
    return 1 if wrong else 0


def show(ledger: Ledger) -> None:
    """All figures, stale ones first."""
    table = Table("figure", "value", "interval", "at", "state", box=None)
    for figure in sorted(ledger.figures.values(), key=lambda f: state_of(f, ledger) != "stale"):
        interval = f"{figure.low:g} to {figure.high:g}"
        at = f"{figure.date} {figure.commit}"
        table.add_row(figure.id, f"{figure.value:g}", interval, at, state_of(figure, ledger))
    Console(width=110).print(table)
    OUT.print(_count_stale(ledger))


def measure(ledger: Ledger, chosen: Sequence[Figure]) -> int:
    """Each command once; what it gives is written at once, so an interruption loses little."""
    commands = dict.fromkeys(f.command for f in chosen)
    failed = False
    for k, command in enumerate(commands, start=1):
        parts = [f for f in chosen if f.command == command]
        OUT.print(f"[{k}/{len(commands)}] {command}: {len(parts)} figures")
        begin = time.perf_counter()
        try:
            form, paths = output_of(command)
            write_sources(command, paths)
            changed = [_again(f, form, ledger) for f in parts]
        except (RuntimeError, KeyError, subprocess.TimeoutExpired) as mistake:
            OUT.print(f"  not measured: {mistake!r}")
            failed = True
            continue
        OUT.print(f"  {time.perf_counter() - begin:.0f} s")
        write_figures(changed)
        ledger = read_ledger()
        for page in write_places(ledger, [f.id for f in changed]):
            OUT.print(f"  {page} changed")
    return 1 if failed else 0


def _again(figure: Figure, form: object, ledger: Ledger) -> Figure:
    """The figure as measured now, told beside the old one."""
    found = picked(form, figure.key)
    today = datetime.datetime.now(tz=datetime.UTC).date().isoformat()
    new = updated(figure, found, _commit(), today, content_of(figure, ledger))
    moved = "" if figure.low <= new.value <= figure.high else "  outside of its interval"
    OUT.print(f"  {figure.id}: {figure.value:g} -> {new.value:g}{moved}")
    return new


def _chosen(ledger: Ledger, only: Sequence[str], stale: bool) -> list[Figure]:
    """What can be measured here; tells what cannot."""
    chosen = []
    for figure in ledger.figures.values():
        asked = not only or any(figure.id == o or figure.id.startswith(f"{o}.") for o in only)
        if figure.kind != "measured" or not asked:
            continue
        if stale and state_of(figure, ledger) != "stale":
            continue
        if figure.needs and not (recordings_folder() / figure.needs).exists():
            OUT.print(f"{figure.id}: left out, no recording {figure.needs}")
        elif not figure.key:
            OUT.print(f"{figure.id}: read it by hand from `{figure.command}`")
        else:
            chosen.append(figure)
    return chosen


def _count_stale(ledger: Ledger) -> str:
    stale = sum(state_of(f, ledger) == "stale" for f in ledger.figures.values())
    return f"{stale} of {len(ledger.figures)} figures are older than the code they depend on"


def _commit() -> str:
    """The commit that is checked out, with a + if files differ from it."""
    words = ["git", "describe", "--always", "--abbrev=7", "--dirty=+", "--exclude=*"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


if __name__ == "__main__":
    sys.exit(main())
