"""A second round of a run: plan for every answer, run the same true plants, analyse again.

The tool's processes get paths of folders; the truth's get the recipe and return recordings. No
answer is opened before the last analysis.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from rulec_runtime.output.write_file import write_text

from rulec.engines.call import Engine
from rulec.prove import campaign
from rulec.prove.analyst import FIRST, FORM, PLAN, ROUND, SECOND, ask_again, plan, read_form
from rulec.prove.campaign import OnProgress, folder_of
from rulec.prove.partition import Partition, Planned
from rulec.prove.results import Further, Judged
from rulec.prove.second_round_inputs import ARMS, RECIPE, run_again
from rulec.prove.second_round_scores import further_of
from rulec.prove.truth.recording import write_csv
from rulec.prove.truth.settled.plan import SettledCase

BEGAN = datetime(2026, 1, 5, 6)
"""When every first recording began."""


def arms_of(baselines: Sequence[str] | None) -> tuple[str, ...]:
    """Return the ways to run plants again: as proposed, and by the named baselines.

    None asks for no baseline, an empty sequence for all of them.
    """
    if baselines is None:
        return (RECIPE,)
    return tuple(arm for arm in ARMS if arm in (RECIPE, *baselines) or not baselines)


def asked_again(
    partition: Partition,
    work: Path,
    seals: Sequence[str],
    arms: Sequence[str],
    engine: Engine,
    on_progress: OnProgress,
) -> None:
    """Plan, run and analyse again every case whose first answer leaves something open.

    Files that a folder has already are kept. Raises Changed if an answer is not what was sealed.
    """

    def done(work_: Callable[..., object], what: str, todo: list[tuple[Any, ...]]) -> None:
        on_progress(what, 0, len(todo))
        for _ in campaign.spread(work_, todo, engine, lambda n: on_progress(what, n, len(todo))):
            pass

    folders = [folder_of(work, i) for i, seal in enumerate(seals) if seal]
    done(plan, "planning", [(f,) for f in folders if not (f / PLAN).exists()])
    lacking = [
        (case, folder_of(work, i), seals[i], arms)
        for i, case in enumerate(partition.cases())
        if seals[i] and any(not recorded(folder_of(work, i), arm) for arm in arms)
    ]
    done(_run, "running again", [words for words in lacking if _recipe(words[1])])
    again = [f / ROUND / arm for arm in arms for f in folders if _recipe(f)]
    done(ask_again, "asking again", [(f,) for f in again if not (f / FORM).exists()])


def judged_again(
    partition: Partition,
    work: Path,
    seals: Sequence[str],
    first: Sequence[Judged],
    arms: Sequence[str],
    engine: Engine,
    on_progress: OnProgress,
) -> list[Further]:
    """Open the answers again, and judge the analyses of both recordings."""
    cases = [(case, i) for i, case in enumerate(partition.cases()) if seals[i]]
    todo = [(case, folder_of(work, i), j, arms) for (case, i), j in zip(cases, first, strict=True)]
    what = "judging again"
    return list(campaign.spread(_judge, todo, engine, lambda n: on_progress(what, n, len(todo))))


def recorded(folder: Path, arm: str) -> bool:
    """Return whether a case has a further recording, or a note that its plant cannot be run so."""
    own = folder / ROUND / arm
    return (own / SECOND).exists() or (own / FORM).exists()


def _recipe(folder: Path) -> dict[str, Any]:
    """Return the recipe of a case; empty if it has no step."""
    found = read_form(folder / PLAN)
    return found if found.get("steps") else {}


def _run(case: Planned, folder: Path, seal: str, arms: Sequence[str]) -> None:
    """Write the first recording with dates, and a further one for each arm."""
    made, _ = campaign.opened(case, folder, seal)
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
