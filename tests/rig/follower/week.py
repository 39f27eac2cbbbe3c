"""Follow a week of rows, one a second, with the runtime alone, and say what memory that took.

A process of its own: `python -m tests.rig.follower.week RULESET.json READINGS.npz`. The readings
are those of an hour, which come again and again.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from pathlib import Path

import numpy as np
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.live.rows import Rows

WEEK = 7 * 24 * 3600


def peak() -> float:
    """Most memory so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main(ruleset: Path, readings: Path, rows: int = WEEK) -> dict[str, float]:
    """Peaks after the first day and after the week, MB; values per second of processor time."""
    rules = read_ruleset(ruleset)
    with np.load(readings) as archive:
        hour = dict(archive)
    count = len(next(iter(hour.values())))
    memory, events, day, begin = nothing_yet(rules, False), 0, 0.0, time.process_time()
    for first in range(0, rows, limits.KEPT_ROWS):
        place = np.arange(first, min(first + limits.KEPT_ROWS, rows))
        values = {name: column[place % count] for name, column in hour.items()}
        for told in follow(rules, memory, Rows(place.astype(float), values)):
            memory, events = told.memory, events + len(told.events)
        if not day and first >= rows // 7:
            day = peak()
    seconds = time.process_time() - begin
    rate = len(hour) * rows / seconds
    return {"day": day, "week": peak(), "events": events, "values_per_second": rate}


if __name__ == "__main__":
    print(json.dumps(main(Path(sys.argv[1]), Path(sys.argv[2]))))
