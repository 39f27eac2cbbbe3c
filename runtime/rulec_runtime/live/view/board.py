"""What all pages show, made once a moment however many look at it."""

from __future__ import annotations

import threading
from collections.abc import Callable

from rulec_runtime.live.now import Now
from rulec_runtime.live.steady import steady
from rulec_runtime.live.view.arrival import Arrival
from rulec_runtime.live.view.html import link_of, main_of, title_of
from rulec_runtime.live.view.limits import TICK


class Board:
    """`state_of` gives the present moment; it is asked from several threads, and answers at once.

    `seal` stands in the forms of the page.
    """

    def __init__(self, state_of: Callable[[], Now], seal: str) -> None:
        self._state_of = state_of
        self._seal = seal
        self._arrival = Arrival()
        self._lock = threading.Lock()
        self._made: tuple[Now, str] | None = None
        self.closing = threading.Event()

    def now(self) -> tuple[Now, float | None]:
        """The present moment, and how long ago its last row came, s."""
        now, clock = self._state_of(), steady()
        with self._lock:
            self._arrival.saw(now.rows, clock)
            return now, self._arrival.age(clock)

    def main(self, now: Now) -> str:
        """HTML of all that changes, but for the connection."""
        with self._lock:
            if self._made is None or self._made[0] is not now:
                self._made = (now, main_of(now, self._seal))
            return self._made[1]

    def link(self, now: Now, age: float | None) -> str:
        """HTML of the connection."""
        return link_of(now, age)

    def title(self, now: Now) -> str:
        """Title of the window: the status stands first."""
        return title_of(now)

    def watch(self) -> None:
        """Look at the moment again and again, so that ages are right though nobody asks."""
        while not self.closing.wait(TICK):
            self.now()
