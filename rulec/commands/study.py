"""`rulec study`: what the diagnoser of a plant can do, before anybody trusts it."""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from rulec_runtime.commands.destinations import console, without_folder, write_json
from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import styled, terminal

from rulec.passes.perturb import true_plan
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors
from rulec.study.campaign import Group, Settings, degrees_of, groups_of, run_group, size_of
from rulec.study.json_form import study_form
from rulec.study.points import Points, operating_points
from rulec.study.pool import run_groups
from rulec.study.summary import percent, rows_of, sentences
from rulec.study.tally import Cell, Tally, tally

Draw = Callable[[np.random.Generator], Plan]

START = 1.0
"""Seconds that starting the processes takes."""


def run(options: argparse.Namespace) -> int:
    """Simulate, judge, count, and say what it means."""
    aside = terminal(aside=True)
    try:
        settings, jobs = settings_of(options)
    except ValueError as mistake:
        return _misused(aside, str(mistake))
    if options.plant.endswith(".json"):
        what = "give the plant's folder; a ruleset alone cannot say how the true plant may differ"
        return _misused(aside, f"{options.plant}: {what}")
    unwritable = without_folder(options, "json")
    if unwritable is not None:
        return _misused(aside, unwritable)
    models = run_passes(Compilation(path=Path(options.plant)))
    ruleset = models.ruleset
    faults = [f.id for f in ruleset.faults]
    if not any(degrees_of(ruleset, fault, settings) for fault in faults):
        what = f"no fault of {ruleset.plant} has such a degree"
        return _misused(aside, f"--degrees {options.degrees}: {what}")
    points = operating_points(equations_of(ruleset), settings.points)

    def draw(random: np.random.Generator) -> Plan:
        return true_plan(models, faults, random)

    aside.print(_announced(ruleset, points, settings, jobs, draw), soft_wrap=True)
    with Progress(console=aside, transient=True) as progress:
        bar = progress.add_task("judging", total=sum(size_of(ruleset, points, settings)))

        def advance(recordings: int) -> None:
            progress.advance(bar, recordings)

        groups = groups_of(ruleset, settings, draw)
        outcomes = run_groups(ruleset, points, settings, groups, jobs, advance)
    modules = models.plant.modules.values()
    types = {module.name: module.type.name for module in modules}
    counts = tally(ruleset, types, outcomes, settings.samples, settings.lead_in)
    if options.json != "-":
        show(console(options), ruleset, types, points, counts)
    write_json(options, study_form(ruleset, points, settings, counts))
    return 0


def _misused(aside: Console, mistake: str) -> int:
    aside.print(f"rulec study: {mistake}", soft_wrap=True)
    return 2


def settings_of(options: argparse.Namespace) -> tuple[Settings, int]:
    """Settings and number of processes; ValueError with a message for a bad argument."""
    try:
        degrees = sorted({float(part) for part in options.degrees.split(",")})
    except ValueError:
        raise ValueError(
            f"--degrees {options.degrees}: give numbers with commas between, such as 0.1,0.2,0.3"
        ) from None
    if not all(math.isfinite(d) and d > 0 for d in degrees):
        raise ValueError(f"--degrees {options.degrees}: a degree is a number above 0 (0.1 is 10 %)")
    jobs = options.jobs if options.jobs is not None else os.cpu_count() or 1
    for name, value, least in (
        ("points", options.points, 1),
        ("seeds", options.seeds, 1),
        ("jobs", jobs, 1),
        ("lead-in", options.lead_in, 0),
    ):
        if value < least:
            raise ValueError(f"--{name} {value}: give {least} or more")
    settings = Settings(
        degrees=tuple(degrees),
        points=options.points,
        seeds=options.seeds,
        mode=options.mode,
        lead_in=options.lead_in,
        errors=SensorErrors(bounded=options.bounded),
    )
    return settings, jobs


def _announced(ruleset: Ruleset, points: Points, settings: Settings, jobs: int, draw: Draw) -> str:
    """Size of the study, and how long it will take, from a few of its recordings."""
    faulty, healthy = size_of(ruleset, points, settings)
    one = Points({name: values[:1] for name, values in points.given.items()}, 1)
    largest = replace(settings, degrees=settings.degrees[-1:])
    ids = [f.id for f in ruleset.faults]

    def seconds(fault: str) -> float:
        group = Group(fault, 0, 0, draw(np.random.default_rng(0)))
        start = time.perf_counter()
        list(run_group(ruleset, one, largest, group))
        return time.perf_counter() - start

    quiet = min(seconds("") for _ in range(2))
    loud = float(np.mean([seconds(f) for f in ids[:: max(1, len(ids) // 3)]])) if ids else 0.0
    total = START * (jobs > 1) + (quiet * healthy + loud * faulty) / jobs
    where = f"{len(points)} operating point{'s' * (len(points) > 1)}"
    lost = f" ({points.tried - len(points)} more have none)" if points.tried > len(points) else ""
    return (
        f"{ruleset.plant}: {faulty} faulty and {healthy} healthy recordings at {where}{lost}; "
        f"about {max(total, 1.0):.0f} s on {jobs} process{'es' * (jobs > 1)}"
    )


def show(
    out: Console,
    ruleset: Ruleset,
    types: Mapping[str, str],
    points: Points,
    counts: Tally,
) -> None:
    """The findings in words, then a table per module type."""
    out.print(styled("\n[bold]{}[/]: what its diagnosis can do\n", ruleset.title))
    for sentence in sentences(counts):
        out.print(f"- {sentence}")
    held = [name for name in points.given if not ruleset.signal_by_id[name].is_input]
    if held:
        out.print(f"- No equation determines {', '.join(held)}: varied like inputs.")
    for kind in dict.fromkeys(types.values()):
        rows = {k: cells for k, cells in rows_of(counts).items() if k.type == kind}
        if rows:
            members = ", ".join(name for name, type_ in types.items() if type_ == kind)
            out.print(styled("\n[bold]{}[/] ({})", kind, members))
            out.print(_table(list(rows.values())))
    legend = (
        "found: something is said to be wrong. named: the true fault comes first; listed: it "
        "comes first or is an alternative. Degree where named: mean absolute error, mean error, "
        "and how often the bounds hold the true one."
    )
    out.print(styled("[dim]{}[/]", legend))


def _table(rows: list[list[Cell]]) -> Table:
    table = Table(pad_edge=False, box=None, padding=(0, 1))
    table.add_column("fault", no_wrap=True)
    for title in ("degree", "runs", "found", "named", "listed", "error", "bias", "in bounds"):
        table.add_column(title, justify="right", no_wrap=True)
    for cells in rows:
        for i, cell in enumerate(cells):
            name = "" if i else cell.fault.title
            table.add_row(name, percent(cell.degree), str(cell.recordings), *_figures(cell))
    return table


def _figures(cell: Cell) -> tuple[str, ...]:
    if not cell.recordings:
        return ("-",) * 6
    shares = [n / cell.recordings for n in (cell.found, cell.named, cell.named + cell.shared)]
    errors = ("-", "-", "-")
    if cell.named:
        covered = percent(cell.covered / cell.named)
        errors = (f"{cell.error:.3f}", f"{cell.bias:+.3f}", covered)
    return (*(percent(s) for s in shares), *errors)
