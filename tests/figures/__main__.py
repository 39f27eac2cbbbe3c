"""The ledger of figures: `python -m tests.figures check|list|measure`.

`check`: pages print what the ledger says, and no number that nobody answers for. `list`: all
measurements, stale ones first. `measure`: run the commands again, rewrite ledger and pages.
"""

import argparse
import subprocess
import sys
from collections.abc import Sequence

from tests.conftest import recordings_folder
from tests.figures.ledger import MEASURED, Ledger, Measurement, misprints, read_ledger, unclaimed
from tests.figures.measure import is_stale, measured_again, write


def main() -> int:
    """Do what is asked; 1 if something is wrong."""
    parser = argparse.ArgumentParser(prog="python -m tests.figures", description=__doc__)
    parser.add_argument("verb", choices=("check", "list", "measure"))
    parser.add_argument("--only", nargs="*", default=(), metavar="ID", help="or its first part")
    parser.add_argument("--stale", action="store_true", help="measure: only what is stale")
    options = parser.parse_args()
    ledger = read_ledger()
    if options.verb == "measure":
        return measure(ledger, _chosen(ledger, options.only, options.stale))
    wrong = [*misprints(ledger), *unclaimed(ledger)] if options.verb == "check" else []
    print(*wrong, sep="\n", end="\n" if wrong else "")
    stale = [m for m in ledger.measurements.values() if is_stale(m, ledger)]
    if options.verb == "list":
        for m in sorted(ledger.measurements.values(), key=lambda m: m not in stale):
            state = "stale" if m in stale else m.kind
            print(f"{state:<13} {m.date:<11} {m.commit:<9} {m.id:<18} {m.command}")
    whole = len(ledger.measurements)
    print(f"{len(wrong)} mistakes; {len(stale)} of {whole} are older than the code")
    return 1 if wrong else 0


def measure(ledger: Ledger, chosen: Sequence[Measurement]) -> int:
    """Each is written at once, so an interruption loses little."""
    failed = False
    for old in chosen:
        print(f"{old.id}: {old.command}")
        try:
            new = measured_again(old, ledger)
        except (RuntimeError, KeyError, subprocess.TimeoutExpired) as mistake:
            print(f"  not measured: {mistake!r}")
            failed = True
            continue
        for path, value in new.values.items():
            print(f"  {path}: {old.values[path]} -> {value}")
        write(new)
    return 1 if failed else 0


def _chosen(ledger: Ledger, only: Sequence[str], stale: bool) -> list[Measurement]:
    """What can be measured here; tells what cannot."""
    chosen = []
    for m in ledger.measurements.values():
        asked = not only or any(f"{m.id}.".startswith(f"{name}.") for name in only)
        if not asked or (stale and not is_stale(m, ledger)):
            continue
        if m.needs and not (recordings_folder() / m.needs).exists():
            print(f"{m.id}: left out, no recording {m.needs}")
        elif m.kind == MEASURED:
            chosen.append(m)
        elif m.kind == "read by hand":
            print(f"{m.id}: read it by hand from `{m.command}`")
    return chosen


if __name__ == "__main__":
    sys.exit(main())
