"""`rulec study`: what the diagnosis of a plant can do, before anyone relies on it."""

from __future__ import annotations

import argparse
import math
import os
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from rulec_runtime.commands.destinations import note_aside, progress_of, show_files
from rulec_runtime.contract.plan import Plan
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.refusal import Misused
from rulec_runtime.report.text import listed

from rulec.commands.arguments import Plant, folder_of
from rulec.engines.engine import chosen
from rulec.passes.compile_cache import open_plant
from rulec.simulation.equations import equations_of
from rulec.simulation.sensing import SensorErrors
from rulec.study.campaign import (
    Group,
    Settings,
    degrees_of,
    groups_of,
    run_group,
    run_groups,
    size_of,
)
from rulec.study.points import Points, operating_points

if TYPE_CHECKING:
    from rulec.commands.study_result import StudyResult


JUDGING = "simulating and judging recordings"

START = 1.0
"""Time to start the processes, s."""


def study(
    plant: Plant,
    *,
    degrees: Sequence[float] = (0.1, 0.2, 0.3),
    points: int = 3,
    seeds: int = 3,
    lead_in: int = 0,
    mode: Literal["default", "paper"] = "default",
    bounded: bool = False,
    jobs: int = 1,
    engine: Literal["local", "dask"] = "local",
    scheduler: str | None = None,
    announce: Callable[[str], None] | None = None,
    progress: Callable[[str, float, float], None] | None = None,
) -> StudyResult:
    """Simulate faults of a plant, diagnose the recordings, and count the outcomes.

    Parameters
    ----------
    plant : folder, plant.yaml, or what `rulec.compile` returned.
    degrees : degrees of every fault.
    points : number of operating points.
    seeds : plants drawn per fault.
    lead_in : healthy samples before the fault.
    mode : ``default`` or ``paper``, as for `rulec.diagnose`.
    bounded : sensor errors stay inside the bounds of their class.
    jobs : processes; a script that asks for several must be guarded by ``__name__ ==
        "__main__"``.
    engine : ``local``: processes of this machine; ``dask``: workers of dask.distributed. The
        results are the same.
    scheduler : address of an existing dask cluster; by default a cluster on this machine.
    announce : called with the size and the expected duration of the study.
    progress : called with the task, the number of judged recordings, and that of all.

    Raises
    ------
    Refused
        The plant has mistakes.
    SimulationRefused
        The plant cannot be simulated.
    Misused
        No fault has such a degree, or a number is too small.

    Examples
    --------
    >>> import rulec
    >>> found = rulec.study("plants/abc", degrees=[0.3], points=1, seeds=1)  # doctest: +SKIP
    >>> found.counts.healthy.alarms  # doctest: +SKIP
    0
    """
    if not all(math.isfinite(d) and d > 0 for d in degrees):
        what = "a degree is a number above 0 (0.1 is 10 %)"
        raise Misused(f"--degrees {_listed(degrees)}: {what}")
    for name, value, least in (("points", points, 1), ("seeds", seeds, 1), ("lead-in", lead_in, 0)):
        if value < least:
            raise Misused(f"--{name} {value}: give {least} or more")
    settings = Settings(
        degrees=tuple(sorted(set(degrees))),
        points=points,
        seeds=seeds,
        mode=mode,
        lead_in=lead_in,
        errors=SensorErrors(bounded=bounded),
    )
    place = chosen(engine, jobs, scheduler)
    lacking = "a ruleset alone cannot say how the true plant may differ"
    opened = open_plant(folder_of(plant, lacking))
    ruleset = opened.ruleset
    faults = [f.id for f in ruleset.faults]
    if not any(degrees_of(ruleset, fault, settings) for fault in faults):
        what = f"no fault of {ruleset.plant} has such a degree"
        raise Misused(f"--degrees {_listed(degrees)}: {what}")
    found = operating_points(equations_of(ruleset), settings.points)

    models = opened.models  # loads the compiler, as do these
    from rulec.commands.study_result import StudyResult
    from rulec.passes.perturb import true_plan
    from rulec.study.tally import tally

    def draw(random: np.random.Generator) -> Plan:
        return true_plan(models, faults, random)

    if announce is not None:
        announce(_announced(ruleset, found, settings, jobs, draw))
    done, size = 0, sum(size_of(ruleset, found, settings))

    def advance(recordings: int) -> None:
        nonlocal done
        done += recordings
        if progress is not None:
            progress(JUDGING, done, size)

    groups = groups_of(ruleset, settings, draw)
    outcomes = run_groups(ruleset, found, settings, groups, place, advance)
    types = {module.name: module.type.name for module in models.plant.modules.values()}
    return StudyResult(
        ruleset=ruleset,
        types=types,
        points=found,
        settings=settings,
        counts=tally(ruleset, types, outcomes, settings.samples, settings.lead_in),
    )


def _listed(degrees: Sequence[float]) -> str:
    return ",".join(f"{degree:g}" for degree in degrees)


def _announced(
    ruleset: Ruleset,
    points: Points,
    settings: Settings,
    jobs: int,
    draw: Callable[[np.random.Generator], Plan],
) -> str:
    """Size and expected duration of the study, from a few of its recordings."""
    faulty, healthy = size_of(ruleset, points, settings)
    one = Points({name: values[:1] for name, values in points.given.items()})
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
    outside = [f for f in ids if not degrees_of(ruleset, f, settings)]
    without = f"; without {listed(outside)}, which cannot have such a degree" if outside else ""
    return (
        f"{ruleset.plant}: {faulty} faulty and {healthy} healthy recordings at {where}{without}; "
        f"about {max(total, 1.0):.0f} s on {jobs} process{'es' * (jobs > 1)}"
    )


def run(options: argparse.Namespace) -> int:
    """Simulate, judge, count, and report what it means."""
    try:
        degrees = [float(part) for part in options.degrees.split(",")]
    except ValueError:
        raise Misused(
            f"--degrees {options.degrees}: give numbers with commas between, such as 0.1,0.2,0.3"
        ) from None
    with ExitStack() as until_done:
        progress = progress_of(options, JUDGING)

        def announce(text: str) -> None:
            note_aside(options, text)
            until_done.enter_context(progress)

        found = study(
            options.plant,
            degrees=degrees,
            points=options.points,
            seeds=options.seeds,
            lead_in=options.lead_in,
            mode=options.mode,
            bounded=options.bounded,
            jobs=options.jobs if options.jobs is not None else os.cpu_count() or 1,
            engine=options.engine,
            scheduler=options.scheduler,
            announce=announce,
            progress=progress,
        )
    show_files(found.hand_out(options), {"report": options.report})
    return 0
