"""A clock for all that waits: it only runs forward, whatever becomes of the machine's.

A process that was frozen, suspended, or thawed on another machine finds its clocks hours ahead, or
set back. What waited by a clock that was set back would wait for as long again.
"""

from __future__ import annotations

import asyncio
import time
from threading import Lock

from rulec_runtime.live.limits import SET_BACK, STOOD_STILL


class Steady:
    """Seconds of the monotonic clock, with steps back left out; `wall` is the same of the date."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._last, self._wall = time.monotonic(), time.time()
        self._back = 0.0

    def __call__(self) -> float:
        with self._lock:
            return self._step()

    def wall(self) -> float:
        """Seconds since 1970; set back by much, it goes on as before until it is caught up."""
        with self._lock:
            self._step()
            return self._wall

    def _step(self) -> float:
        here = time.monotonic()
        passed = max(here - self._last, 0.0)
        self._back += max(self._last - here, 0.0)
        wall, as_before = time.time(), self._wall + passed
        self._last, self._wall = here, wall if as_before - wall < SET_BACK else as_before
        return here + self._back


steady = Steady()


def steady_loop() -> asyncio.AbstractEventLoop:
    """An event loop that waits by this clock."""
    loop = asyncio.new_event_loop()
    loop.time = steady  # type: ignore[method-assign]
    return loop


class Standstill:
    """Whether this process stood still: what does something again and again says so by `moves`."""

    def __init__(self) -> None:
        self.moves()

    def moves(self) -> None:
        """It does not stand still now."""
        self._at = steady(), time.time()

    @property
    def lasted(self) -> float:
        """For how long nothing moved, s; 0 where that was not long. In a suspended machine the
        monotonic clock may stand as well."""
        most = max(steady() - self._at[0], time.time() - self._at[1])
        return most if most > STOOD_STILL else 0.0
