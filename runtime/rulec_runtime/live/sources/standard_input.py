"""Standard input, or any other pipe, as a table that comes row by row."""

from __future__ import annotations

import os
import select
import sys
from pathlib import Path

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.line_cutter import LineCutter
from rulec_runtime.live.sources.remarks import Remarks, Silence, notice
from rulec_runtime.live.sources.row_clock import RowClock
from rulec_runtime.live.sources.table_stream import TableStream
from rulec_runtime.live.steady import steady
from rulec_runtime.recordings.csv_table import RecordingRefused

NAME = "standard input"


class StandardInput:
    """Rows of a pipe until it ends."""

    def __init__(self, ruleset: Ruleset, descriptor: int | None = None) -> None:
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor
        self._remarks = Remarks()
        self._clock = RowClock(NAME, self._remarks)
        self._cutter = LineCutter()
        self._table = TableStream(Path(NAME), ruleset, self._clock, self._remarks)
        self._silence = Silence(limits.STALE)
        self.ended = False

    @property
    def dated(self) -> bool:
        """Known from the first rows on."""
        return bool(self._clock.dated)

    def take(self, seconds: float) -> list[Rows | Notice]:
        until = steady() + seconds
        while not self.ended:
            left = until - steady()
            if not select.select([self._descriptor], [], [], max(0.0, left))[0]:
                return self._stale()
            data = os.read(self._descriptor, limits.PIECE)
            found = self._read(data)
            self._silence.seconds = max(limits.STALE, limits.STALE_STEPS * self._clock.step)
            if not any(isinstance(part, Rows) for part in found):
                found += self._stale()
            elif self._silence.heard():
                found.insert(0, notice("connected", self._clock.now, f"{NAME}: rows come again"))
            if found or left <= 0:
                return found
        return []

    def close(self) -> None:
        self.ended = True

    def _read(self, data: bytes) -> list[Rows | Notice]:
        lines = self._cutter.feed(data) if data else self._cutter.rest()
        found: list[Rows | Notice] = []
        if self._cutter.too_long:
            self._cutter.too_long = 0
            text = f"{NAME}: lines of more than {limits.LONGEST_LINE} bytes are left out"
            found += self._remarks.tell("refused", "too long", self._clock.now, text)
        try:
            found += self._table.feed(lines)
            found += [] if data else self._table.end()
        except RecordingRefused as refused:
            found += [notice("refused", self._clock.now, str(refused))]
            data = b""
        if not data:
            self.ended = True
            found += [notice("ended", self._clock.now, f"{NAME} has ended")]
        return found

    def _stale(self) -> list[Rows | Notice]:
        if not self._silence.begins():
            return []
        text = f"{NAME}: no row for {self._silence.lasts:.0f} s"
        return [notice("stale", self._clock.now, text)]
