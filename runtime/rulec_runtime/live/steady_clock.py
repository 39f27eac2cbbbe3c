"""A clock for all waiting that never runs back, whatever happens to the machine's clock.

A process that was frozen, suspended, or resumed on another machine finds its clocks hours ahead or
behind. A wait by a clock that was set back would last that much longer.
"""

import asyncio
import time
from threading import Lock

from rulec_runtime.live.limits import SET_BACK, STOOD_STILL


class Steady:
    """Seconds of the monotonic clock without steps back; `wall` is the same for the date."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._last, self._wall = time.monotonic(), time.time()
        self._back = 0.0

    def __call__(self) -> float:
        with self._lock:
            return self._step()

    def wall(self) -> float:
        """Seconds since 1970; after a large step back it continues until the date has caught up."""
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
    """An event loop that uses this clock."""
    loop = asyncio.new_event_loop()
    loop.time = steady  # type: ignore[method-assign]
    return loop


class Standstill:
    """Detects that this process stood still; a periodic task calls `moves`."""

    def __init__(self) -> None:
        self.moves()

    def moves(self) -> None:
        """Record a sign of life."""
        self._at = steady(), time.time()

    @property
    def lasted(self) -> float:
        """Seconds since the last sign of life; 0 if that is not long. The monotonic clock may also
        stop in a suspended machine."""
        most = max(steady() - self._at[0], time.time() - self._at[1])
        return most if most > STOOD_STILL else 0.0
