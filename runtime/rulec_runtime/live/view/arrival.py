"""How old the last row is, by the clock of whoever looks: those of plants go wrong."""

from __future__ import annotations


class Arrival:
    """When the count of rows last rose."""

    def __init__(self) -> None:
        self._rows = 0
        self._since: float | None = None

    def saw(self, rows: int, time: float) -> None:
        """So many rows had come at a time, s, of a clock that only runs forward."""
        if rows != self._rows:
            self._rows, self._since = rows, time

    def age(self, time: float) -> float | None:
        """How long ago the last row came, s; None before any."""
        return None if self._since is None else max(time - self._since, 0.0)
