"""Run the groups of a study in several processes."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing.synchronize import Event

from rulec_runtime.contract.ruleset import Ruleset

from rulec.study.campaign import Group, Settings, run_group
from rulec.study.judge import Outcome
from rulec.study.points import Points


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
    waiting = list(groups)
    # Not forked: a progress bar's thread may hold a lock, and other systems cannot fork.
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    arguments = (ruleset, points, settings, stop)
    with ProcessPoolExecutor(jobs, context, _start, arguments) as pool:
        try:
            with _interrupts_held():
                futures = [pool.submit(_run, group) for group in waiting]
            for future in as_completed(futures):
                advance(len(future.result()))
        except BaseException:
            stop.set()
            # Waiting: an executor that is gone cancels nothing.
            pool.shutdown(wait=True, cancel_futures=True)
            raise
        return [outcome for future in futures for outcome in future.result()]


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Processes started in here inherit that an interrupt is the parent's business.

    The parent sees one that comes meanwhile behind this: a process that is interrupted, or whose
    parent is, while it starts would print a traceback.
    """
    if threading.current_thread() is not threading.main_thread() or os.name != "posix":
        yield
        return
    held: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, _: held.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
    if held:
        raise KeyboardInterrupt


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
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _WORKER.append(_Worker(ruleset, points, settings, stop))


def _run(group: Group) -> list[Outcome]:
    (worker,) = _WORKER
    outcomes: list[Outcome] = []
    if not worker.stop.is_set():
        for outcome in run_group(worker.ruleset, worker.points, worker.settings, group):
            outcomes.append(outcome)
            if worker.stop.is_set():
                break
    return outcomes
