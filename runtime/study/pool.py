"""Run the groups of a study in several processes."""

from __future__ import annotations

import contextlib
import multiprocessing
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing.synchronize import Event

from runtime.ruleset import Ruleset
from runtime.study.campaign import Group, Settings, run_group
from runtime.study.judge import Outcome
from runtime.study.points import Points


@dataclass
class _Worker:
    """What a process needs for every group; set once when it starts."""

    ruleset: Ruleset
    points: Points
    settings: Settings
    stop: Event


_WORKER: list[_Worker] = []


def run_groups(
    ruleset: Ruleset,
    points: Points,
    settings: Settings,
    groups: Iterable[Group],
    jobs: int,
    advance: Callable[[int], None],
) -> list[Outcome]:
    """Outcomes in the order of the groups, whatever the number of processes.

    `advance` is called with the number of recordings judged since. An interrupt stops all
    processes within a recording's time.
    """
    if jobs == 1:
        return _run_here(ruleset, points, settings, groups, advance)
    # Not forked: a progress bar's thread may hold a lock, and other systems cannot fork.
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    arguments = (ruleset, points, settings, stop)
    with ProcessPoolExecutor(jobs, context, _start, arguments) as pool:
        try:
            with _interrupts_ignored():
                futures = [pool.submit(_run, group) for group in groups]
            for future in as_completed(futures):
                advance(len(future.result()))
        except BaseException:
            stop.set()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
        return [outcome for future in futures for outcome in future.result()]


@contextlib.contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """Processes started in here inherit that an interrupt is the parent's business."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _run_here(
    ruleset: Ruleset,
    points: Points,
    settings: Settings,
    groups: Iterable[Group],
    advance: Callable[[int], None],
) -> list[Outcome]:
    outcomes = []
    for group in groups:
        for outcome in run_group(ruleset, points, settings, group):
            outcomes.append(outcome)
            advance(1)
    return outcomes


def _start(ruleset: Ruleset, points: Points, settings: Settings, stop: Event) -> None:
    _WORKER.append(_Worker(ruleset, points, settings, stop))


def _run(group: Group) -> list[Outcome]:
    (worker,) = _WORKER
    outcomes = []
    for outcome in run_group(worker.ruleset, worker.points, worker.settings, group):
        if worker.stop.is_set():
            break
        outcomes.append(outcome)
    return outcomes
