"""`rulec fleet`: judge many plants on many days and rank them, or ask what models leave out."""

from __future__ import annotations

import argparse
import json
import tempfile
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
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
from rulec_runtime.output.write_file import write_data, write_text

from rulec.commands.arguments import ruleset_of
from rulec.engines.call import Call, Engine
from rulec.engines.engine import chosen
from rulec.engines.engine import run as run_on
from rulec.fleet.fleet_file import Fleet, read_fleet
from rulec.fleet.plant_days import judged, tasks_of
from rulec.fleet.ranking import NOT_JUDGED, Ranked, fleet_page, ranked, verdict
from rulec.fleet.store import PlantDays, Store, parquet_of, tables
from rulec.fleet.trends import Trend, trends_of
from rulec.limits import WORKER_DEATHS

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
    store = Store(fleet.results, fleet.plant_key, fleet.day_key)
    days = list(dict.fromkeys(task.day for task in tasks))
    count = plural(len({task.plant for task in tasks}), "plant", "plants")
    counted = f"{fleet.name}: {count} on {plural(len(days), 'day', 'days')}, "

    def judge(left: Sequence[Task]) -> Iterator[tuple[Task, Row]]:
        return judged(engine, left, fleet.rulesets)

    with progress_of(options, JUDGING) as progress:
        _work_off(options, tasks, store, judge, partial(progress, JUDGING), counted)
        rows = tables(store, tasks, lambda number: progress(WRITING, number, len(days)))
    plants = ranked(rows)
    trends = [*trends_of(store.rows(tasks), fleet.rulesets)]
    page = fleet.results / "ranking.html"
    write_text(page, fleet_page(fleet, plants, days, trends))
    write_json(options, _form(fleet, plants, rows, trends))
    _show(console(options), plants, trends, page)
    return 0


def _work_off(
    options: argparse.Namespace,
    tasks: Sequence[Task],
    store: Store | Answers,
    work: Callable[[Sequence[Task]], Iterable[tuple[Task, Any]]],
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
    answers = Answers(fleet.results, fleet.plant_key, fleet.day_key)

    def ask(left: Sequence[Task]) -> Iterator[tuple[Task, dict[str, Any]]]:
        return asked(engine, left, fleet)

    with progress_of(options, ASKING) as progress:
        _work_off(options, tasks, answers, ask, partial(progress, ASKING), f"{fleet.name}: ")
    rows = answers.rows(tasks)
    table = answers.write_table(rows)
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
    _show_answers(console(options), rows, table)
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


def _show_answers(out: Console, rows: Sequence[Answer], written: Path) -> None:
    out.print(styled("\n[bold]{}[/]\n", summary(rows)))
    off = differing(rows)
    table = Table(pad_edge=False, box=None, padding=(0, 1))
    for title in ("plant", "day", "verdict", "what", "probability"):
        table.add_column(title, justify="right" if title == "probability" else "left")
    for row in [*off, *(r for r in rows if r.verdict in UNTOLD)][:PLANT_DAYS_SHOWN]:
        sure = "" if row.probability is None else f"{100 * row.probability:.0f} %"
        table.add_row(row.plant, row.day, row.verdict, row.text or row.reason, sure)
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


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The result of `rulec mismatch` for a plant-day.

    Attributes
    ----------
    verdict : of `rulec mismatch`, or ``unread``, with a `reason`.
    text : the answer in a sentence or two.
    module, place, effect, title : of the first explanation; empty if there is none.
    probability : of that explanation; None if there is none.
    signal, unit : the predicted signal, and the unit of its errors at held-out points.
    shipped, recalibrated, repaired, noise : root mean square errors of the model as it is, with
        other values, with what it left out, and of readings alone; None if nothing was compared.
    """

    plant: str
    day: str
    verdict: str
    text: str = ""
    reason: str = ""
    module: str = ""
    place: str = ""
    effect: str = ""
    title: str = ""
    probability: float | None = None
    signal: str = ""
    unit: str = ""
    shipped: float | None = None
    recalibrated: float | None = None
    repaired: float | None = None
    noise: float | None = None


def answer_of(task: Task, form: Mapping[str, Any]) -> Answer:
    """The row of an answer in JSON form, or of a reason why there is none."""
    if "reason" in form:
        return Answer(plant=task.plant, day=task.day, verdict=UNASKED, reason=form["reason"])
    none: dict[str, Any] = {}
    first = next(iter(form["effects"]), none)
    where = next(iter(form["locations"]), none)
    fit = form["fit"] or none
    heldout = fit.get("heldout") or none
    names = ("shipped", "recalibrated", "repaired", "noise")
    errors: dict[str, Any] = {name: heldout.get(name) for name in names}
    return Answer(
        plant=task.plant,
        day=task.day,
        verdict=form["verdict"],
        text=form["headline"],
        module=where.get("module", ""),
        place=where.get("place", ""),
        effect=first.get("effect") or "",
        title=first.get("title", ""),
        probability=first.get("probability"),
        signal=fit.get("signal", ""),
        unit=fit.get("unit", ""),
        **errors,
    )


class Answers(PlantDays):
    """Answers in a folder."""

    def __init__(self, folder: Path, plant_key: str, day_key: str) -> None:
        super().__init__(folder, plant_key, day_key, "mismatch-answers", ".json")

    def keep(self, task: Task, form: Mapping[str, Any]) -> None:
        """Write an answer."""
        self.put(task, (json.dumps(form, indent=1, ensure_ascii=False) + "\n").encode())

    def rows(self, tasks: Iterable[Task]) -> list[Answer]:
        """Rows of plant-days that are done."""
        return [
            answer_of(task, json.loads(self.file(task).read_text(encoding="utf-8")))
            for task in tasks
        ]

    def write_table(self, rows: Sequence[Answer]) -> Path:
        """Write all rows as one Parquet file; returns its path."""
        numbers = ("probability", "shipped", "recalibrated", "repaired", "noise")
        names = Answer.__dataclass_fields__
        fields = [(name, "double" if name in numbers else "string") for name in names]
        file = self.folder / "mismatch.parquet"
        write_data(file, parquet_of(map(asdict, rows), fields))
        return file


def differing(rows: Iterable[Answer]) -> list[Answer]:
    """Plant-days that differ from their models."""
    return [row for row in rows if row.verdict not in (SOUND, *UNTOLD)]


def summary(rows: Sequence[Answer]) -> str:
    """All answers in a sentence: how many plants differ, and by what most often."""
    plants = {row.plant for row in rows}
    off = differing(rows)
    which = {row.plant for row in off}
    if not which:
        sound = {row.plant for row in rows if row.verdict == SOUND}
        agree = plural(len(sound), "plant agrees with its model", "plants agree with their models")
        return agree if sound else "no recording says anything of a model"
    differ = "differs from its model" if len(which) == 1 else "differ from their models"
    text = f"{len(which)} of {plural(len(plants), 'plant', 'plants')} {differ}"
    each = Counter(title for title, _ in {(row.title, row.plant) for row in off if row.title})
    title, count = min(each.items(), key=lambda one: (-one[1], one[0]), default=("", 0))
    return f"{text}; most often by: {title} ({count} plants)" if count > 1 else text
