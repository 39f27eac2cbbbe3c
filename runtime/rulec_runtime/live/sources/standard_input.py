"""Standard input, or another pipe, as a table that comes row by row."""

from __future__ import annotations

import os
import select
import sys
from pathlib import Path

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.rows import Notice, Rows
from rulec_runtime.live.sources import limits
from rulec_runtime.live.sources.table_stream import TextSource
from rulec_runtime.live.steady_clock import steady
from rulec_runtime.recordings.csv_table import RecordingRefused


class StandardInput(TextSource):
    """Rows of a pipe until it ends."""

    def __init__(self, ruleset: Ruleset, descriptor: int | None = None) -> None:
        super().__init__(Path("standard input"), ruleset)
        self._descriptor = sys.stdin.fileno() if descriptor is None else descriptor

    def take(self, seconds: float) -> list[Rows | Notice]:
        until = steady() + seconds
        while not self.ended:
            left = until - steady()
            if not select.select([self._descriptor], [], [], max(0.0, left))[0]:
                return self._stale()
            data = os.read(self._descriptor, limits.PIECE)
            found = self._read(data)
            if not self._heard(found):
                found += self._stale()
            elif self._silence.heard():
                found.insert(0, self._notice("connected", ": rows come again"))
            if found or left <= 0:
                return found
        return []

    def close(self) -> None:
        self.ended = True

    def _read(self, data: bytes) -> list[Rows | Notice]:
        lines = self._cutter.feed(data) if data else self._cutter.rest()
        found = self._too_long()
        try:
            found += self._table.feed(lines)
            found += [] if data else self._table.end()
        except RecordingRefused as refused:
            found.append(self._refusal(refused))
            data = b""
        if not data:
            self.ended = True
            found.append(self._notice("ended", " has ended"))
        return found
