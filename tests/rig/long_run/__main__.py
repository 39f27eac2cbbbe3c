"""The long run, measured: `python -m tests.rig.long_run rows|courses|pairs|year`.

With `--json -` the tables go to standard error and the machine form to standard output.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.rig.long_run import courses, pairs, rows, year


def _rows(out: Console, options: argparse.Namespace) -> dict[str, Any]:
    answers = rows.measure(options.first, options.seeds or 1, options.only)
    table = Table("row", "rig", "variant", "said", "wrong with that", box=None)
    for a in answers:
        table.add_row(a.row, a.rig, a.variant, a.said, "\n".join(a.complaints) or "[green]right[/]")
    out.print(table)
    form = rows.form(answers)
    out.print(
        f"{form['right']} of {form['recordings']} recordings, {form['rows_right']} rows right"
    )
    return form


def _courses(out: Console, options: argparse.Namespace) -> dict[str, Any]:
    form = courses.form(
        courses.measure(options.first, options.seeds or courses.DRAWN, options.live)
    )
    table = Table(
        "course", "true", "said", "", "true rate", "said", "reaches", "truly", "within", box=None
    )
    for one in form["courses"]:
        table.add_row(*(str(one[key]) for key in courses.COLUMNS))
    out.print(table)
    _counts(out, form["counts"])
    return form


def _pairs(out: Console, options: argparse.Namespace) -> dict[str, Any]:
    form = pairs.form(pairs.measure(options.first, options.seeds or pairs.DRAWN))
    for one in form["misses"]:
        out.print(f"{one['number']:>3} {one['what']}: [bold]{one['verdict']}[/] {one['said']}")
    table = Table("problem", *pairs.VERDICTS, box=None)
    for problem, counts in form["by_problem"].items():
        table.add_row(problem, *(str(counts[v]) for v in pairs.VERDICTS))
    out.print(table)
    _counts(out, form["counts"])
    return form


def _year(out: Console, options: argparse.Namespace) -> dict[str, Any]:
    form = year.measure(
        options.first, options.days, whole=options.whole, rig=options.rig, season=options.kelvin
    )
    for alarm in form["alarms"]:
        out.print(f"day {alarm['day']}: {alarm['said']}")
    _counts(out, {k: v for k, v in form.items() if k != "alarms"})
    return form


ASKED = {"rows": _rows, "courses": _courses, "pairs": _pairs, "year": _year}


def main() -> None:
    """Ask one question after the other."""
    parser = argparse.ArgumentParser(prog="python -m tests.rig.long_run", description=__doc__)
    parser.add_argument("questions", nargs="*", metavar="QUESTION", help=", ".join(ASKED))
    parser.add_argument("--first", type=int, default=0, help="seed or number to begin with")
    parser.add_argument("--seeds", type=int, help="how many (default: 1 of rows, all of the rest)")
    parser.add_argument("--only", default="", help="rows whose name contains this")
    parser.add_argument("--live", action="store_true", help="courses: play them to a watch, too")
    parser.add_argument("--rig", default="abc", help="of the year (default abc)")
    parser.add_argument("--days", type=int, default=365, help="of the year (default 365)")
    parser.add_argument("--kelvin", type=float, default=year.SEASON, help="of its seasons")
    parser.add_argument("--whole", action="store_true", help="the year as one recording")
    parser.add_argument("--json", metavar="FILE", help="machine form; - for standard output")
    options = parser.parse_args()
    if strangers := set(options.questions) - set(ASKED):
        parser.error(f"no question {', '.join(sorted(strangers))}")
    out = Console(width=190, highlight=False, stderr=options.json == "-")
    form = {}
    for name in options.questions or ASKED:
        begin = time.perf_counter()
        form[name] = ASKED[name](out, options)
        out.print(f"{name}: {time.perf_counter() - begin:.0f} s\n", style="dim")
    if options.json == "-":
        print(json.dumps(form, indent=1))
    elif options.json:
        Path(options.json).write_text(json.dumps(form, indent=1) + "\n", encoding="utf-8")


def _counts(out: Console, counts: Mapping[str, Any]) -> None:
    for name, value in counts.items():
        out.print(f"{name.replace('_', ' ')}: {value}")


if __name__ == "__main__":
    main()
