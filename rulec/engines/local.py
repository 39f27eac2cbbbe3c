"""Work in processes of this machine."""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from rulec_runtime.output.interrupts import interrupts_deferred

from rulec.engines.call import Call
from rulec.limits import WORK_AHEAD, WORKER_DEATHS

B = TypeVar("B")

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
"""Matrices are small, and threads of the linear algebra would only wait for each other."""


def run(
    work: Callable[..., B],
    calls: Sequence[Call],
    shared: Mapping[str, str | bytes],
    jobs: int,
    died: Callable[[int], B],
) -> Iterator[tuple[int, B]]:
    """Do all calls in processes that share nothing with this one."""
    waiting, deaths = list(reversed(range(len(calls)))), Counter[int]()
    under_way: dict[Future[B], int] = {}

    def fill(pool: ProcessPoolExecutor) -> None:
        """Submit calls, as far as a few are ahead; alone what a process died at, as only one of
        the calls under way may have killed it."""
        while waiting and len(under_way) < WORK_AHEAD * jobs:
            if under_way and any(deaths[n] for n in (waiting[-1], *under_way.values())):
                return
            call = calls[waiting[-1]]
            more: tuple[Any, ...] = () if call.shared is None else (shared[call.shared],)
            future = pool.submit(work, *call.words, *more)
            under_way[future] = waiting.pop()

    while waiting:
        under_way.clear()
        with _pool(jobs) as pool:
            try:
                with interrupts_deferred():
                    fill(pool)
                while under_way:
                    done, _ = wait(under_way, return_when=FIRST_COMPLETED)
                    for future in done:
                        result = future.result()
                        yield under_way.pop(future), result
                    fill(pool)
            except BrokenProcessPool:
                for future, number in under_way.items():
                    if future.done() and future.exception() is None:
                        yield number, future.result()
                        continue
                    deaths[number] += 1
                    if deaths[number] >= WORKER_DEATHS:
                        yield number, died(number)
                    else:
                        waiting.append(number)


@contextlib.contextmanager
def _pool(jobs: int) -> Iterator[ProcessPoolExecutor]:
    """Processes that stop in the middle of their work if an exception leaves this context, or if
    this process ends."""
    # Not forked: threads of the parent may hold a lock, and other systems cannot fork.
    context = multiprocessing.get_context("spawn")
    theirs, ours = context.Pipe(duplex=False)
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    pool = ProcessPoolExecutor(jobs, context, _start, (theirs,))
    try:
        yield pool
    except BaseException:
        ours.close()
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        ours.close()
        theirs.close()
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _start(lifeline: Connection) -> None:
    """Leave interrupts to the parent; end if its end of the lifeline closes."""

    def wait_for_parent() -> None:
        with contextlib.suppress(EOFError, OSError):
            lifeline.recv_bytes()
        os._exit(1)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=wait_for_parent, daemon=True).start()
