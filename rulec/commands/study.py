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
from rich.table import Table
from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    note_aside,
    progress_of,
    write_json,
    write_to,
)
from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.made import made_now

from rulec.passes.perturb import true_plan
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors
from rulec.study.campaign import Group, Settings, degrees_of, groups_of, run_group, size_of
from rulec.study.json_form import study_form
from rulec.study.page import study_page
from rulec.study.points import Points, operating_points
from rulec.study.pool import run_groups
from rulec.study.summary import LEGEND, TITLES, figures_of, percent, rows_of, sentences
from rulec.study.tally import Cell, Tally, tally

Draw = Callable[[np.random.Generator], Plan]

JUDGING = "simulating and judging recordings"

START = 1.0
"""Seconds that starting the processes takes."""


def run(options: argparse.Namespace) -> int:
    """Simulate, judge, count, and say what it means."""
    settings, jobs = settings_of(options)
    if options.plant.endswith(".json"):
        what = "give the plant's folder; a ruleset alone cannot say how the true plant may differ"
        raise Misused(f"{options.plant}: {what}")
    check_outputs(options)
    models = run_passes(Compilation(path=Path(options.plant)))
    ruleset = models.ruleset
    faults = [f.id for f in ruleset.faults]
    if not any(degrees_of(ruleset, fault, settings) for fault in faults):
        what = f"no fault of {ruleset.plant} has such a degree"
        raise Misused(f"--degrees {options.degrees}: {what}")
    points = operating_points(equations_of(ruleset), settings.points)

    def draw(random: np.random.Generator) -> Plan:
        return true_plan(models, faults, random)

    note_aside(options, _announced(ruleset, points, settings, jobs, draw))
    with progress_of(options, JUDGING) as progress:
        size, done = sum(size_of(ruleset, points, settings)), 0

        def advance(recordings: int) -> None:
            nonlocal done
            done += recordings
            progress(JUDGING, done, size)

        groups = groups_of(ruleset, settings, draw)
        outcomes = run_groups(ruleset, points, settings, groups, jobs, advance)
    modules = models.plant.modules.values()
    types = {module.name: module.type.name for module in modules}
    counts = tally(ruleset, types, outcomes, settings.samples, settings.lead_in)
    out = console(options)
    show(out, ruleset, types, points, counts)
    if options.report:
        page = study_page(ruleset, types, points, settings, counts, made_now("rulec"))
        write_to(options.report, page)
        out.print(styled("[dim]report: {}[/]", options.report))
    write_json(options, study_form(ruleset, points, settings, counts))
    return 0


def settings_of(options: argparse.Namespace) -> tuple[Settings, int]:
    """Settings and number of processes; `Misused` with a message for a bad argument."""
    try:
        degrees = sorted({float(part) for part in options.degrees.split(",")})
    except ValueError:
        raise Misused(
            f"--degrees {options.degrees}: give numbers with commas between, such as 0.1,0.2,0.3"
        ) from None
    if not all(math.isfinite(d) and d > 0 for d in degrees):
        raise Misused(f"--degrees {options.degrees}: a degree is a number above 0 (0.1 is 10 %)")
    jobs = options.jobs if options.jobs is not None else os.cpu_count() or 1
    for name, value, least in (
        ("points", options.points, 1),
        ("seeds", options.seeds, 1),
        ("jobs", jobs, 1),
        ("lead-in", options.lead_in, 0),
    ):
        if value < least:
            raise Misused(f"--{name} {value}: give {least} or more")
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
    out.print(styled("[dim]{}[/]", LEGEND))


def _table(rows: list[list[Cell]]) -> Table:
    table = Table(pad_edge=False, box=None, padding=(0, 1))
    table.add_column("fault", no_wrap=True)
    for title in TITLES:
        table.add_column(title, justify="right", no_wrap=True)
    for cells in rows:
        for i, cell in enumerate(cells):
            name = "" if i else cell.fault.title
            table.add_row(name, percent(cell.degree), str(cell.recordings), *figures_of(cell))
    return table
