"""Judge plant-days in processes of this machine."""

from __future__ import annotations

import multiprocessing
import signal
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from rulec_runtime.fleet.plant_day import Row, judge_day
from rulec_runtime.fleet.task import Task

from rulec.fleet.failed import died
from rulec.limits import FLEET_AHEAD, FLEET_DEATHS


def run(
    tasks: Sequence[Task], rulesets: Mapping[str, str], jobs: int
) -> Iterator[tuple[Task, Row]]:
    """Judge in so many processes; results come as they are done.

    Where a process dies, what it had in work is judged again by a new one. A plant-day at which
    processes died again and again becomes a row that says so.
    """
    waiting, deaths = list(reversed(tasks)), Counter[Task]()
    while waiting:
        work: dict[Future[Row], Task] = {}
        # Not forked: threads of the parent may hold a lock.
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(jobs, context, _start)
        try:
            while waiting or work:
                while waiting and len(work) < FLEET_AHEAD * jobs:
                    task = waiting.pop()
                    work[pool.submit(judge_day, task, rulesets[task.ruleset])] = task
                done, _ = wait(work, return_when=FIRST_COMPLETED)
                for future in done:
                    row = future.result()
                    yield work.pop(future), row
        except BrokenProcessPool:
            for future, task in work.items():
                finished = future.done() and future.exception() is None
                if finished:
                    yield task, future.result()
                    continue
                deaths[task] += 1
                if deaths[task] >= FLEET_DEATHS:
                    yield task, died(task)
                else:
                    waiting.append(task)
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _start() -> None:
    """An interrupt is the parent's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
