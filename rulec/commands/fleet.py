"""`rulec fleet`: judge many plants on many days and rank them, or ask what models leave out."""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from functools import partial
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
from rulec_runtime.fleet.plant_day import Row, Task, fetched, reason_of
from rulec_runtime.output.plural import plural
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.commands.arguments import ruleset_of
from rulec.engines.call import Call, Engine
from rulec.engines.engine import chosen
from rulec.fleet.fleet_file import Fleet, read_fleet
from rulec.fleet.plant_days import judged, tasks_of, worked_off
from rulec.fleet.ranking import NOT_JUDGED, Ranked, fleet_page, ranked, verdict
from rulec.fleet.store import ANSWERS, MISMATCH, Store, tables, write_table
from rulec.fleet.trends import Trend, trends_of

JUDGING, WRITING, ASKING = "judging plant-days", "writing the tables", "asking plant-days"

SHOWN, PLANT_DAYS_SHOWN = 10, 20
"""Plants, and plant-days with `--mismatch`, that the terminal shows."""


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
        return _ask(options, fleet, engine)
    tasks = tasks_of(fleet)
    store = Store(fleet)
    days = list(dict.fromkeys(task.day for task in tasks))
    count = plural(len({task.plant for task in tasks}), "plant", "plants")
    counted = f"{fleet.name}: {count} on {plural(len(days), 'day', 'days')}, "

    def judge(left: Sequence[Task]) -> Iterator[tuple[Task, Row]]:
        return judged(engine, left, fleet.rulesets)

    with progress_of(options, JUDGING) as progress:
        _work_off(options, tasks, store, judge, partial(progress, JUDGING), counted)
        rows = tables(store, tasks, lambda number: progress(WRITING, number, len(days)))
    plants = ranked(rows)
    trends = [*trends_of(store.results(tasks), fleet.rulesets)]
    page = fleet.results / "ranking.html"
    write_text(page, fleet_page(fleet, plants, days, trends))
    write_json(options, _form(fleet, plants, rows, trends))
    _show(console(options), plants, trends, page)
    return 0


def _work_off(
    options: argparse.Namespace,
    tasks: Sequence[Task],
    store: Store,
    work: Callable[[Sequence[Task]], Iterable[tuple[Task, Row]]],
    progress: Callable[[float, float], None],
    counted: str,
) -> None:
    """Do what is not done, and keep each result at once: a run that was stopped goes on there."""
    left = [task for task in tasks if options.again or not store.is_done(task)]
    done = len(tasks) - len(left)
    before = f"; {plural(done, 'is', 'are')} done already" if done else ""
    note_aside(options, f"{counted}{plural(len(tasks), 'plant-day', 'plant-days')}{before}")
    if left:
        progress(done, len(tasks))
        for number, (task, result) in enumerate(work(left), done + 1):
            store.keep(task, result)
            progress(number, len(tasks))


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


def _ask(options: argparse.Namespace, fleet: Fleet, engine: Engine) -> int:
    """Ask about the open plant-days, write the table, report what was found."""
    _check(Path(options.fleet), fleet)
    tasks = tasks_of(fleet)
    answers = Store(fleet, ANSWERS)

    def ask(left: Sequence[Task]) -> Iterator[tuple[Task, Row]]:
        return asked(engine, left, fleet)

    with progress_of(options, ASKING) as progress:
        _work_off(options, tasks, answers, ask, partial(progress, ASKING), f"{fleet.name}: ")
    rows = [*map(answer_of, tasks, answers.results(tasks))]
    table = fleet.results / "mismatch.parquet"
    write_table(table, MISMATCH, rows)
    write_json(
        options,
        {
            "fleet": fleet.name,
            "verdict": summary(rows),
            "results": str(fleet.results),
            "plant_days": [
                row | {"answer": str(answers.file(task))}
                for task, row in zip(tasks, rows, strict=True)
            ],
        },
    )
    _show_answers(console(options), rows, table)
    return 0


def asked(engine: Engine, tasks: Sequence[Task], fleet: Fleet) -> Iterator[tuple[Task, Row]]:
    """Answers in JSON form as they arrive."""
    calls = [Call((task, fleet.judged_by[task.ruleset])) for task in tasks]
    return worked_off(engine, ask_day, tasks, calls, lambda _: {})


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


def _show_answers(out: Console, rows: Sequence[Row], written: Path) -> None:
    out.print(styled("\n[bold]{}[/]\n", summary(rows)))
    off = differing(rows)
    table = Table(pad_edge=False, box=None, padding=(0, 1))
    for title in ("plant", "day", "verdict", "what", "probability"):
        table.add_column(title, justify="right" if title == "probability" else "left")
    for row in [*off, *(r for r in rows if r["verdict"] in UNTOLD)][:PLANT_DAYS_SHOWN]:
        sure = "" if row["probability"] is None else f"{100 * row['probability']:.0f} %"
        shown = (row["plant"], row["day"], row["verdict"], row["text"] or row["reason"], sure)
        table.add_row(*shown)
    if table.row_count:
        out.print(table)
    if len(off) > PLANT_DAYS_SHOWN:
        out.print(styled("[dim]and {} more[/]", len(off) - PLANT_DAYS_SHOWN))
    out.print(styled("[dim]all of them: {}[/]", written), soft_wrap=True)


def ask_day(task: Task, plant: str) -> dict[str, Any]:
    """The answer in JSON form; `plant` is the folder of the plant.

    Never raises for the content of files: the answer is then a ``reason``.
    """
    from rulec.commands.mismatch import mismatch

    try:
        with ExitStack() as stack:
            files = [fetched(file, stack) for file in task.files]
            return mismatch(plant, _recording(files, stack)).to_dict()
    except Exception as error:
        return {"reason": reason_of(error, "compared")}


def _recording(files: list[Path], stack: ExitStack) -> Path:
    """The files of a plant-day as one recording: their common folder, or a new one of links."""
    folders = {file.parent for file in files}
    if len(files) == 1:
        return files[0]
    if len(folders) == 1:
        return folders.pop()
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rulec-")))
    for number, file in enumerate(files):
        (folder / f"{number:04d}-{file.name}").symlink_to(file.resolve())
    return folder


SOUND = "none"
"""Verdict if a model and its plant agree."""

UNASKED = "unread"
"""Verdict if the recording could not be analysed."""

UNTOLD = ("cannot judge", UNASKED)
"""Verdicts that say nothing about a model."""


def answer_of(task: Task, form: Row) -> Row:
    """The row of a table of an answer in JSON form, or of a reason why there is none.

    Its place is the first one, its effect that of the first explanation; `shipped`, `recalibrated`,
    `repaired` and `noise` are errors of the predicted `signal` at held-out points, in its `unit`,
    None if nothing was compared.
    """
    where, first = ([*form.get(part, ()), {}][0] for part in ("locations", "effects"))
    fit = form.get("fit") or {}
    heldout = fit.get("heldout") or {}
    errors = ("shipped", "recalibrated", "repaired", "noise")
    return {
        "plant": task.plant,
        "day": task.day,
        "verdict": form.get("verdict", UNASKED),
        "text": form.get("headline", ""),
        "reason": form.get("reason", ""),
        "module": where.get("module", ""),
        "place": where.get("place", ""),
        "effect": first.get("effect") or "",
        "title": first.get("title", ""),
        "probability": first.get("probability"),
        "signal": fit.get("signal", ""),
        "unit": fit.get("unit", ""),
        **{name: heldout.get(name) for name in errors},
    }


def differing(rows: Iterable[Row]) -> list[Row]:
    """Plant-days that differ from their models."""
    return [row for row in rows if row["verdict"] not in (SOUND, *UNTOLD)]


def summary(rows: Sequence[Row]) -> str:
    """All answers in a sentence: how many plants differ, and by what most often."""
    plants = {row["plant"] for row in rows}
    off = differing(rows)
    which = {row["plant"] for row in off}
    if not which:
        sound = {row["plant"] for row in rows if row["verdict"] == SOUND}
        agree = plural(len(sound), "plant agrees with its model", "plants agree with their models")
        return agree if sound else "no recording says anything of a model"
    differ = "differs from its model" if len(which) == 1 else "differ from their models"
    text = f"{len(which)} of {plural(len(plants), 'plant', 'plants')} {differ}"
    titles = {(row["title"], row["plant"]) for row in off if row["title"]}
    each = Counter(title for title, _ in titles)
    title, count = min(each.items(), key=lambda one: (-one[1], one[0]), default=("", 0))
    return f"{text}; most often by: {title} ({count} plants)" if count > 1 else text
