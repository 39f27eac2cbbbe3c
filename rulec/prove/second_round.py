"""A second round of a run: plan for every answer, run the same true plants, analyse again.

The plant gets the recipe, or baselines of equal length. The tool's processes get paths of folders;
the truth's get the recipe and return recordings. No answer is opened before the last analysis.
"""

import json
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.output.write_file import write_text

from rulec.prove.analyst import FIRST, FORM, PLAN, ROUND, SECOND, ask_again, plan, read_form
from rulec.prove.campaign import Campaign, open_case
from rulec.prove.partition import Planned
from rulec.prove.results import ARMS, RECIPE, SAME, Further, Judged
from rulec.prove.second_round_table import further_of
from rulec.prove.truth.recording import write_csv
from rulec.prove.truth.settled.further_recording import (
    Point,
    displayed,
    held,
    recorded_further,
    repeated,
)
from rulec.prove.truth.settled.plan import SettledCase
from rulec.prove.truth.settled.solve import Stalled
from rulec.prove.truth.streams import stream
from rulec.prove.truth.units import Array

Held = tuple[Point, int]
"""Set points by input, and the number of samples for which they are held."""


def run_again(
    case: SettledCase, recipe: Mapping[str, Any], arm: str, seed: int
) -> dict[str, Array]:
    """Return the columns of a further recording by header, as long as the recipe.

    Steps at which the plant cannot run are left out, as an operator would. Raises ValueError if the
    recipe sets what nobody can set, or if no step is left.
    """
    if arm == SAME:
        samples = sum(samples_of(recipe, case.scene.pace))
        return recorded_further(case, repeated(case.scene, samples))

    def run(steps: Sequence[Held]) -> dict[str, Array]:
        points, samples = zip(*steps, strict=True)
        return recorded_further(case, held(case, points, samples))

    def runs(step: Held) -> bool:
        try:
            run([step])
        except Stalled:
            return False
        return True

    steps = steps_of(case, recipe, arm, seed)
    try:
        return run(steps)
    except Stalled:
        return run([step for step in steps if runs(step)] or steps)


def steps_of(case: SettledCase, recipe: Mapping[str, Any], arm: str, seed: int) -> list[Held]:
    """Return the set points of each step, in the units of the sensors, and its samples.

    Those of a baseline are drawn between the displayed limits of the inputs, or else within their
    range in the first recording.
    """
    scene, limits = case.scene, case.may_be_set
    points = [{n: float(i["value"]) for n, i in s["inputs"].items()} for s in recipe["steps"]]
    if arm != RECIPE:
        ranges = {}
        for name in sorted({name for point in points for name in point}):
            if not limits or name in limits:
                values = scene.given[name][scene.first :]
                ends = limits.get(name, (values.min(), values.max()))
                ranges[name] = [displayed(case, name, float(end)) for end in ends]
        shares = stream(seed, "random inputs").uniform(size=(len(points), len(ranges)))
        low, high = np.array(list(ranges.values())).reshape(-1, 2).T
        drawn = (low + shares * (high - low)).tolist()
        points = [{**points[-1], **dict(zip(ranges, row, strict=True))} for row in drawn]
    return list(zip(points, samples_of(recipe, scene.pace), strict=True))


def samples_of(recipe: Mapping[str, Any], pace: float) -> list[int]:
    """Return the samples of each step, at least one; `pace` is the sampling interval in s."""
    ends = [0.0, *(float(step["until"]) for step in recipe["steps"])]
    return [max(round(b / pace) - round(a / pace), 1) for a, b in pairwise(ends)]


BEGAN = datetime(2026, 1, 5, 6)
"""When every first recording began."""


def arms_of(baselines: Sequence[str] | None) -> tuple[str, ...]:
    """Return the ways to run plants again: as proposed, and by the named baselines.

    None asks for no baseline, an empty sequence for all of them.
    """
    if baselines is None:
        return (RECIPE,)
    return tuple(arm for arm in ARMS if arm in (RECIPE, *baselines) or not baselines)


def asked_again(run: Campaign, seals: Sequence[str], arms: Sequence[str]) -> None:
    """Plan, run and analyse again every case whose first answer leaves something open.

    Files that a folder has already are kept. Raises Changed if an answer is not what was sealed.
    """
    made, each = run.made(seals), run.workers.each
    folders = [folder for _, folder, _ in made]
    each("planning", plan, [(f,) for f in folders if not (f / PLAN).exists()])
    lacking = (one for one in made if not all(recorded(one[1], arm) for arm in arms))
    each("running again", _write_runs, [(*one, arms) for one in lacking if _recipe(one[1])])
    again = [f / ROUND / arm for arm in arms for f in folders if _recipe(f)]
    each("asking again", ask_again, [(f,) for f in again if not (f / FORM).exists()])


def judged_again(
    run: Campaign, seals: Sequence[str], first: Sequence[Judged], arms: Sequence[str]
) -> list[Further]:
    """Open the answers again, and judge the analyses of both recordings."""
    cases = zip(run.made(seals), first, strict=True)
    todo = [(case, folder, judged, arms) for (case, folder, _), judged in cases]
    return run.workers.each("judging again", _judge, todo)


def recorded(folder: Path, arm: str) -> bool:
    """Return whether a case has a further recording, or a note that its plant cannot be run so."""
    own = folder / ROUND / arm
    return (own / SECOND).exists() or (own / FORM).exists()


def _recipe(folder: Path) -> dict[str, Any]:
    """Return the recipe of a case; empty if it has no step."""
    found = read_form(folder / PLAN)
    return found if found.get("steps") else {}


def _write_runs(case: Planned, folder: Path, seal: str, arms: Sequence[str]) -> None:
    """Write the first recording with dates, and a further one for each arm."""
    made, _ = open_case(case, folder, seal)
    assert isinstance(made, SettledCase)
    own = folder / ROUND
    own.mkdir(exist_ok=True)
    write_text(own / FIRST, dated((folder / "recording.csv").read_text(encoding="utf-8")))
    for arm in arms:
        if recorded(folder, arm):
            continue
        (own / arm).mkdir(exist_ok=True)
        try:
            columns = run_again(made, _recipe(folder), arm, made.answer.seed)
        except ValueError as refused:
            # The plant cannot be run so, and the operator keeps the first answer.
            write_text(own / arm / FORM, json.dumps({"not_run": str(refused)}))
            continue
        seconds = own / arm / "seconds.csv"
        write_csv(seconds, columns)
        write_text(own / arm / SECOND, dated(seconds.read_text(encoding="utf-8")))
        seconds.unlink()


def _judge(case: Planned, folder: Path, first: Judged, arms: Sequence[str]) -> Further:
    recipe, before = read_form(folder / PLAN), read_form(folder / FORM)
    again = arms if recipe.get("steps") else ()
    after = {arm: read_form(folder / ROUND / arm / FORM) for arm in again}
    return further_of(case.make().answer, first, recipe, before, after)


def dated(text: str) -> str:
    """Replace seconds in a CSV recording by dates, so that two recordings share a time axis."""
    head, *rows = text.splitlines()
    lines = [f"time,{head.partition(',')[2]}"]
    for row in rows:
        seconds, _, rest = row.partition(",")
        date = BEGAN + timedelta(seconds=round(float(seconds)))
        lines.append(f"{date.isoformat(sep=' ')},{rest}")
    return "\n".join(lines) + "\n"
