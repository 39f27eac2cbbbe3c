"""Judge tasks in several processes, each replicate commissioned once."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from rich.progress import Progress

from tests.rig.mixing_rig.cases import Task
from tests.rig.mixing_rig.commission import commission, key_of, ruleset_file
from tests.rig.mixing_rig.judge import Judged, judge


def run(
    folder: Path, tasks: Sequence[Task], workers: int, progress: Progress | None = None
) -> Judged:
    """All answers in the order of the tasks; with fewer than 2 workers in this process.

    `folder` keeps the rulesets, for the tasks of a later call.
    """
    wanted = dict.fromkeys(key_of(task) for task in tasks)
    keys = [key for key in wanted if not ruleset_file(folder, key).exists()]
    prepare, answer = functools.partial(commission, folder), functools.partial(judge, folder)
    if workers < 2:
        for key in keys:
            prepare(key)
        return _joined([answer(task) for task in tasks])
    bar = progress or Progress(disable=True)
    with ProcessPoolExecutor(workers) as pool:
        for _ in bar.track(pool.map(prepare, keys), len(keys), description="calibrating"):
            pass
        judged = pool.map(answer, tasks, chunksize=4)
        return _joined(list(bar.track(judged, len(tasks), description="judging")))


def _joined(parts: Sequence[Judged]) -> Judged:
    return Judged(
        tuple(a for part in parts for a in part.answers),
        tuple(s for part in parts for s in part.samples),
        tuple(c for part in parts for c in part.covered),
    )
