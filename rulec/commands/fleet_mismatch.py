"""`rulec fleet --mismatch`: ask of many plants what physics their models leave out."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rulec_runtime.commands.destinations import console, note_aside, progress_of, write_json
from rulec_runtime.fleet.plant_day import Task
from rulec_runtime.output.plural import plural
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import styled

from rulec.api.plant_day import ask_day
from rulec.engines.call import Call, Engine
from rulec.engines.engine import run as run_on
from rulec.fleet.answers import UNTOLD, Answer, Answers, differing, summary
from rulec.fleet.fleet_file import Fleet
from rulec.fleet.plant_days import tasks_of
from rulec.limits import WORKER_DEATHS

ASKING = "asking plant-days"

SHOWN = 20
"""Plant-days that the terminal shows."""


def run(options: argparse.Namespace, fleet: Fleet, engine: Engine) -> int:
    """Ask about the open plant-days, write the table, report what was found."""
    _check(Path(options.fleet), fleet)
    tasks = tasks_of(fleet)
    answers = Answers(fleet.results, fleet.plant_key, fleet.day_key)
    left = tasks if options.again else [task for task in tasks if not answers.is_done(task)]
    done = len(tasks) - len(left)
    counted = plural(len(tasks), "plant-day", "plant-days")
    before = f"; {plural(done, 'is', 'are')} done already" if done else ""
    note_aside(options, f"{fleet.name}: {counted}{before}")
    with progress_of(options, ASKING) as progress:
        if left:
            progress(ASKING, done, len(tasks))
            for task, form in asked(engine, left, fleet):
                answers.keep(task, form)
                done += 1
                progress(ASKING, done, len(tasks))
    rows = answers.rows(tasks)
    table = answers.write_table(rows)
    _show(console(options), rows, table)
    write_json(
        options,
        {
            "fleet": fleet.name,
            "verdict": summary(rows),
            "results": str(fleet.results),
            "plant_days": [
                asdict(row) | {"answer": str(answers.file(task))}
                for task, row in zip(tasks, rows, strict=True)
            ],
        },
    )
    return 0


def asked(
    engine: Engine, tasks: Sequence[Task], fleet: Fleet
) -> Iterator[tuple[Task, dict[str, Any]]]:
    """Answers as they arrive, in JSON form.

    If processes died at a plant-day, its answer says so.
    """
    calls = [Call((task, fleet.judged_by[task.ruleset])) for task in tasks]

    def died(_: int) -> dict[str, Any]:
        return {"reason": f"{WORKER_DEATHS} processes died at it; is there enough memory?"}

    for number, form in run_on(engine, ask_day, calls, died=died):
        yield tasks[number], form


def _check(file: Path, fleet: Fleet) -> None:
    """Refuse rulesets, which hold no physics, and column titles of the fleet."""
    for place in sorted(set(fleet.judged_by.values())):
        if not Path(place).is_dir() and Path(place).suffix == ".json":
            raise Refusal(
                f"{file}: {place} is a ruleset; --mismatch needs the folder of the plant: name it "
                "in 'judged_by'"
            )
    if fleet.titles:
        raise Refusal(
            f"{file}: --mismatch knows columns by the plants' own column maps alone; write what "
            "stands in 'titles' into columns.yaml of the plant"
        )


def _show(out: Console, rows: Sequence[Answer], written: Path) -> None:
    out.print(styled("\n[bold]{}[/]\n", summary(rows)))
    off = differing(rows)
    table = Table(pad_edge=False, box=None, padding=(0, 1))
    for title in ("plant", "day", "verdict", "what", "probability"):
        table.add_column(title, justify="right" if title == "probability" else "left")
    for row in [*off, *(r for r in rows if r.verdict in UNTOLD)][:SHOWN]:
        sure = "" if row.probability is None else f"{100 * row.probability:.0f} %"
        table.add_row(row.plant, row.day, row.verdict, row.text or row.reason, sure)
    if table.row_count:
        out.print(table)
    if len(off) > SHOWN:
        out.print(styled("[dim]and {} more[/]", len(off) - SHOWN))
    out.print(styled("[dim]all of them: {}[/]", written), soft_wrap=True)
