"""Count how often the right fault is named first: `python -m tests.rig.isolation [TABLE...]`.

Each recording has sensor errors of its own; calibrations are made as a maker makes them, from a
bench recording with errors of its own, and taken in turn. With `--json -` the tables go to
standard error and the machine form to standard output.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from tests.rig.isolation.count import sound_form, table_form
from tests.rig.isolation.tables import ASKED, TABLES, Scale
from tests.rig.mixing_rig.run import run

COLUMNS = ("first", "mentioned", "surely_wrong", "unknown", "silent", "covered")


def main() -> None:
    """Ask the tables one after the other."""
    options = _options()
    scale = Scale(
        options.plant,
        tuple(float(x) for x in options.degrees.split(",")),
        options.repetitions,
        options.draws,
        tuple(options.faults),
        options.samples,
    )
    out = Console(width=130, highlight=False, stderr=options.json == "-")
    form: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.tables or ASKED:
            tasks, begin = ASKED[name](scale), time.perf_counter()
            with Progress(console=Console(stderr=True), transient=True) as progress:
                judged = run(Path(folder), tasks, options.workers, progress)
            form[name] = table_form(judged) if name in TABLES else sound_form(judged)
            out.print(f"[bold]{name}[/]: {len(tasks)} recordings")
            _show(out, name, form[name])
            out.print(f"{time.perf_counter() - begin:.0f} s\n", style="dim")
    if options.json == "-":
        print(json.dumps(form, indent=1))
    elif options.json:
        Path(options.json).write_text(json.dumps(form, indent=1) + "\n", encoding="utf-8")


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.rig.isolation", description=__doc__)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=", ".join(ASKED))
    parser.add_argument("--plant", default="abc", help="of rulec.prove.truth.RIGS (default abc)")
    parser.add_argument("--degrees", default="0.1,0.2,0.3", help="default 0.1,0.2,0.3")
    parser.add_argument("--repetitions", type=int, default=10, help="of each case (default 10)")
    parser.add_argument("--draws", type=int, default=61, help="calibrations (default 61)")
    parser.add_argument("--samples", type=int, default=100_000, help="sound ones (default 100000)")
    parser.add_argument("--faults", nargs="*", default=(), help="parts of names, such as P_el")
    parser.add_argument("--workers", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--json", metavar="FILE", help="machine form; - for standard output")
    options = parser.parse_args()
    if strangers := set(options.tables) - set(ASKED):
        parser.error(f"no table {', '.join(sorted(strangers))}")
    return options


def _show(out: Console, name: str, form: Mapping[str, Any]) -> None:
    if name not in TABLES:
        out.print(
            f"{form['samples']} sound samples, {form['recordings']} recordings: "
            f"{form['fault']['count']} in a fault, {form['unknown']['count']} in none known, "
            f"{form['fault_per_100000']:g} false alarms in 100,000  {' '.join(form['named'])}"
        )
        return
    table = Table(title=TABLES[name].title, box=None, title_justify="left")
    table.add_column("")
    for column in ("points", "first", "from", "to", *COLUMNS[1:], "error"):
        table.add_column(column.replace("_", " "), justify="right")
    rows = {"all": form["all"]}
    rows |= {f"degree {key}": row for key, row in form["degree"].items()}
    rows |= form["kind_and_degree"]
    for title, row in rows.items():
        shares = [_cell(row[column]["value"]) for column in COLUMNS[1:]]
        first = [_cell(row["first"][key]) for key in ("value", "low", "high")]
        table.add_row(title, str(row["points"]), *first, *shares, _cell(row["error"], 4))
    out.print(table)


def _cell(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


if __name__ == "__main__":
    main()
