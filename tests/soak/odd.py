"""What cannot be read of a source is told as long as it lasts: OPC UA values that are odd."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from tests.soak import score
from tests.soak.plant import course
from tests.soak.sources import STEP, Served, watched

HOW = ("uncertain", "array", "gone")
STALE = 2.0
BEFORE, LASTS, APART = 150, 50, 50
"""Rows before a signal is odd, while it is, and between two times."""


def opcua(folder: Path, times: int) -> dict[str, Any]:
    """Status Uncertain, an array, a node that is deleted and comes back: in turn."""
    rows = BEFORE + times * (LASTS + APART)
    what, served = course(folder, rows), Served("opcua", folder)
    odd = [(k, k + LASTS, HOW[i % 3]) for i, k in enumerate(range(BEFORE, rows, LASTS + APART))]
    served.keys = {"stale": STALE}
    watch, start = watched(folder, what, served, odd=odd)
    time.sleep(max(start + (rows + 10) * STEP - time.time(), 0.0))
    code = watch.interrupt()
    served.kill()
    events = score.events_of(folder / "journal.db")
    signal = what.titles[0].partition(" ")[0]
    mine = [e for e in events if e.episode.kind == "source" and e.episode.subject == signal]
    told = [
        {e.what for e in mine if first <= (e.time - start) / STEP < first + LASTS + APART}
        for first, _, _ in odd
    ]
    whole = sum({"began", "ended"} <= what for what in told)
    return {
        "tried": len(odd),
        "survived": whole if code == 0 else 0,
        "lost": sum("began" not in what for what in told),
        "twice": max(sum(e.what == "began" for e in mine) - len(odd), 0),
        **score.numbers(e.number for e in events),
        **score.bad_output(watch.out + watch.err),
    }
