"""Collect a column of times that comes in parts, in the form of the file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rulec_runtime.contract.file_form import Order
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.dates import dates_of
from rulec_runtime.recordings.larger_than_memory import Growing
from rulec_runtime.recordings.table import Cells, Dates, texts_of
from rulec_runtime.recordings.time_column import plain_times


class GrowingCells:
    """Numbers, dates or texts; texts if the kinds are mixed."""

    def __init__(self, most: int | None, beside: int) -> None:
        self._room = most, beside
        self._numbers: Growing | None = None
        self._dates: tuple[Growing, Growing] | None = None
        self._texts: list[str] | None = None
        self._known: dict[str, str] = {}

    def add(self, cells: Cells) -> None:
        """Append cells."""
        if isinstance(cells, Dates) and self._numbers is None and self._texts is None:
            self._dates = self._dates or (Growing(*self._room), Growing(*self._room))
            self._dates[0].append(cells.seconds)
            self._dates[1].append(cells.zones)
        elif isinstance(cells, np.ndarray) and self._dates is None and self._texts is None:
            self._numbers = self._numbers or Growing(*self._room)
            self._numbers.append(cells)
        else:
            if self._texts is None:
                self._texts = list(texts_of(self.joined()))
            # Tags and qualities are few and repeat: equal texts share one object.
            known = self._known if len(self._known) < limits.FEW_TEXTS else {}
            self._texts += [known.setdefault(cell, cell) for cell in texts_of(cells)]
            self._numbers = self._dates = None

    def joined(self) -> Cells:
        """All cells."""
        if self._dates is not None:
            return Dates(self._dates[0].joined(), self._dates[1].joined())
        if self._numbers is not None:
            return self._numbers.joined()
        return np.zeros(0) if self._texts is None else self._texts


class GrowingTimes:
    """Texts of times, kept as numbers if one of them is a number, else as dates.

    Other texts are NaN, as in `read_times`, which gets all texts at once.
    """

    def __init__(self, most: int, beside: int, order: Order) -> None:
        self._numbers, self._dates = Growing(most, beside), GrowingCells(most, beside)
        self._order = order
        self._plain = False
        self._first: list[str] = []

    def add(self, cells: Sequence[str] | Array) -> None:
        """Append texts, or finite numbers."""
        if isinstance(cells, np.ndarray):
            self._numbers.append(cells)
            self._plain = True
            return
        self._first = self._first or list(cells[:1])
        numbers = plain_times(cells)
        self._numbers.append(numbers)
        self._plain = self._plain or bool(np.isfinite(numbers).any())
        if not self._plain:
            self._dates.add(Dates(*dates_of(cells, self._order)))

    def joined(self) -> Cells:
        """All times; the first text if none is a time."""
        if self._plain:
            return self._numbers.joined()
        dates = self._dates.joined()
        if isinstance(dates, Dates) and np.isfinite(dates.seconds).any():
            return dates
        return self._first
