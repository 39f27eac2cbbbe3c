"""`rulec fleet`: judge many plants on many days, and rank those that need attention."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from rich.console import Console
from rich.table import Table
from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    note_aside,
    progress_of,
    write_json,
)
from rulec_runtime.fleet.plant_day import Row, Task
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.api.arguments import ruleset_of
from rulec.engines.engine import chosen
from rulec.fleet.fleet_file import Fleet, read_fleet
from rulec.fleet.plant_days import judged, tasks_of
from rulec.fleet.ranking import NOT_JUDGED, Ranked, fleet_page, ranked, verdict
from rulec.fleet.store import Store, tables
from rulec.fleet.trends import Trend, trends_of

JUDGING, WRITING = "judging plant-days", "writing the tables"

SHOWN = 10
"""Plants that the terminal shows."""


def run(options: argparse.Namespace) -> int:
    """Judge the open plant-days, write tables and ranking."""
    check_outputs(options)
    engine = chosen(options.engine, options.jobs, options.scheduler)
    results = None if options.results is None else Path(options.results).resolve()
    fleet = read_fleet(Path(options.fleet), ruleset_of, results)
    if "://" in fleet.recordings:
        address = urlsplit(fleet.recordings)  # may hold a password
        host = f"{address.scheme}://{address.hostname or ''}"
        note_aside(options, f"{fleet.name}: recordings come from {host}")
    if options.mismatch:
        from rulec.commands import fleet_mismatch

        return fleet_mismatch.run(options, fleet, engine)
    tasks = tasks_of(fleet)
    store = Store(fleet.results, fleet.plant_key, fleet.day_key)
    left = tasks if options.again else [task for task in tasks if not store.is_done(task)]
    done = len(tasks) - len(left)
    before = f"; {plural(done, 'is', 'are')} done already" if done else ""
    note_aside(options, f"{fleet.name}: {_counted(tasks)}{before}")
    with progress_of(options, JUDGING) as progress:
        if left:
            progress(JUDGING, done, len(tasks))
            for task, row in judged(engine, left, fleet.rulesets):
                store.keep(task, row)
                done += 1
                progress(JUDGING, done, len(tasks))
        days = list(dict.fromkeys(task.day for task in tasks))
        rows = tables(store, tasks, lambda number: progress(WRITING, number, len(days)))
    plants = ranked(rows)
    trends = [*trends_of(store.rows(tasks), fleet.rulesets)]
    page = fleet.results / "ranking.html"
    write_text(page, fleet_page(fleet, plants, days, trends))
    write_json(options, _form(fleet, plants, rows, trends))
    _show(console(options), plants, trends, page)
    return 0


def _counted(tasks: Sequence[Task]) -> str:
    plants, days = ({getattr(t, name) for t in tasks} for name in ("plant", "day"))
    return (
        f"{plural(len(plants), 'plant', 'plants')} on {plural(len(days), 'day', 'days')}, "
        f"{plural(len(tasks), 'plant-day', 'plant-days')}"
    )


def _show(out: Console, plants: Sequence[Ranked], trends: Sequence[Trend], page: Path) -> None:
    out.print(styled("\n[bold]{}[/]\n", verdict(plants)))
    table = Table(pad_edge=False, box=None, padding=(0, 1))
    for title in ("plant", "status", "health", "worst day", "what"):
        table.add_column(title, justify="right" if title == "health" else "left")
    for one in plants[:SHOWN]:
        grey = None if one.health is not None else "dim"
        health = NOT_JUDGED if one.health is None else f"{100 * one.health:.1f} %"
        table.add_row(one.plant, one.status, health, one.worst, one.text, style=grey)
    out.print(table)
    if len(plants) > SHOWN:
        out.print(styled("[dim]and {} more[/]", len(plants) - SHOWN))
    for trend in trends[:SHOWN]:
        out.print(styled("[bold]{}[/] over days, {}", trend.plant, trend.text))
    out.print(styled("[dim]ranking: {}[/]", page), soft_wrap=True)


def _form(
    fleet: Fleet, plants: Sequence[Ranked], rows: Sequence[Row], trends: Sequence[Trend]
) -> dict[str, Any]:
    return {
        "fleet": fleet.name,
        "verdict": verdict(plants),
        "results": str(fleet.results),
        "plants": [asdict(one) for one in plants],
        "trends": [
            {**{k: v for k, v in vars(one).items() if k != "growth"}, **one.growth}
            for one in trends
        ],
        "not_judged": [
            {"plant": row["plant"], "day": row["day"], "because": row["reason"]}
            for row in rows
            if not row["judged"]
        ],
    }
