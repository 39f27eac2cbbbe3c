"""A disk that is full for a while: nothing lost, nothing twice."""

import time
from pathlib import Path
from typing import Any

from tests.live.disks import filled, mounted
from tests.soak import score
from tests.soak.plant import LEAD, OFF, ON, Logger, course
from tests.soak.watching import Watch

PAUSE = 0.05  # s from row to row
FULL = 4.0  # s that the disk is full: longer than a fault or the time between two
FREE = 4.0


def full(folder: Path, times: int) -> dict[str, Any]:
    """The journal is on the disk: the watch runs on."""
    rows = int((times + 1) * (FULL + FREE) / PAUSE) + LEAD + ON + OFF
    what, small = course(folder, rows), folder / "small"
    with mounted(small, "6m") as there:
        if not there:
            return {"skipped": "mounting a small file system needs root"}
        watch = Watch(folder, "--source", "log.csv", journal="small/journal.db")
        ran = 0
        with Logger(folder / "log.csv", what, PAUSE) as logger:
            time.sleep(1.0)
            watch.start()
            for _ in range(times):
                _alive(watch, FREE)
                ballast = filled(small)
                time.sleep(FULL)
                ran += watch.runs
                ballast.unlink()
            while not logger.over.wait(0.5):
                _alive(watch, 0.0)
        if watch.runs:
            time.sleep(12.0)  # the journal is tried again within ten seconds
            watch.interrupt()
        watch.start("--until-end")
        code = watch.ended()
        events, judged = watch.events, watch.rows
    return {
        "tried": times,
        "ran_on": ran,
        "starts": watch.lives,
        "survived": ran if code == 0 else 0,
        "rows": rows,
        "rows_lost": rows - judged,
        **score.outcome(events, what.planted, said=watch.said),
    }


def _alive(watch: Watch, seconds: float) -> None:
    """Start it again where it ended, as systemd does."""
    until = time.monotonic() + seconds
    while True:
        if not watch.runs:
            watch.start()
        if time.monotonic() >= until:
            return
        time.sleep(0.5)
