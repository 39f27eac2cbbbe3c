"""A process that writes and is killed."""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection

from rulec_runtime.live.episode import Event

from tests.live.journal.events import event

Commit = Callable[[Sequence[Event], bytes], None]


def written_until_killed(opened: Callable[[], tuple[int, Commit]], times: int) -> int:
    """Kill a writer at random moments; the number of the last event that it told as written.

    `opened` gives the number of the last event that is there, and what writes more.
    """
    last = 0
    for _ in range(times):
        ours, theirs = multiprocessing.Pipe(duplex=False)
        child = multiprocessing.get_context("fork").Process(target=_write, args=(opened, theirs))
        child.start()
        theirs.close()
        assert ours.poll(20), "the writer writes nothing"
        time.sleep(random.uniform(0.0, 0.03))
        assert child.pid is not None
        os.kill(child.pid, signal.SIGKILL)
        child.join()
        while True:
            try:
                last = max(last, ours.recv())
            except EOFError:
                break
        ours.close()
    return last


def _write(opened: Callable[[], tuple[int, Commit]], told: Connection) -> None:
    last, commit = opened()
    for number in range(last + 1, last + 10_000):
        # The event before comes again, as after a kill between writing and telling.
        commit([event(n) for n in (number - 1, number) if n > 0], str(number).encode())
        told.send(number)
