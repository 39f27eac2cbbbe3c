"""A bounded queue from the thread that reads the plant to the one that takes rows."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from threading import Condition

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.remarks import notice
from rulec_runtime.output.plural import plural

_Row = tuple[float, Array]


class Handover:
    """Rows and notices in order of arrival.

    If nobody takes them in time, the oldest rows are dropped with a notice 'gap'.
    """

    def __init__(self, signals: Sequence[str]) -> None:
        self._signals = tuple(signals)
        self._rows: deque[tuple[int, _Row]] = deque()
        self._notices: deque[tuple[int, Notice]] = deque(maxlen=limits.QUEUED_NOTICES)
        self._count = 0
        self._dropped, self._since = 0, 0.0
        self._changed = Condition()

    def row(self, time: float, values: Array) -> None:
        """Add a row: its time, s, and the readings of the signals in their order, SI."""
        with self._changed:
            self._count += 1
            self._rows.append((self._count, (time, values)))
            if len(self._rows) > limits.QUEUED_ROWS:
                _, (gone, _) = self._rows.popleft()
                self._since = self._since if self._dropped else gone
                self._dropped += 1
            self._changed.notify()

    def notices(self, found: Sequence[Notice]) -> None:
        with self._changed:
            for one in found:
                self._count += 1
                self._notices.append((self._count, one))
            self._changed.notify()

    def take(self, seconds: float) -> list[Rows | Notice]:
        """Everything in the queue, after waiting at most so many seconds for it."""
        with self._changed:
            if not (self._rows or self._notices):
                self._changed.wait(seconds)
            rows, self._rows = self._rows, deque()
            notices = list(self._notices)
            self._notices.clear()
            dropped, self._dropped = self._dropped, 0
        found: list[Rows | Notice] = []
        if dropped:
            text = f"{plural(dropped, 'row was', 'rows were')} dropped: nobody took them in time"
            found.append(notice("gap", self._since, text))
        block: list[_Row] = []
        for number, one in notices:
            while rows and rows[0][0] < number:
                block.append(rows.popleft()[1])
            found += [*self._block(block), one]
            block = []
        return found + self._block([*block, *(row for _, row in rows)])

    def _block(self, rows: Sequence[_Row]) -> list[Rows | Notice]:
        if not rows:
            return []
        table = np.array([values for _, values in rows])
        columns = {name: table[:, i].copy() for i, name in enumerate(self._signals)}
        return [Rows(np.array([time for time, _ in rows]), columns)]
