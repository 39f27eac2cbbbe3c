"""The watch stands still, as in a container that is frozen, and goes on."""

import time
from pathlib import Path
from typing import Any

from tests.soak import score
from tests.soak.plant import LEAD, OFF, ON, Logger, course
from tests.soak.sources import STEP, Served, watched
from tests.soak.watching import Watch

FROZEN = 15.0  # s: longer than all that a source, a server or a broker waits
AGAIN = 15.0  # s between two times
PATIENCE = 30.0
PAUSE = 0.1  # s from row to row of a file


def file(folder: Path, times: int) -> dict[str, Any]:
    """Beside a logger that goes on."""
    rows = LEAD + ON + OFF + int((times + 1) * (FROZEN + AGAIN + 5.0) / PAUSE)
    what = course(folder, rows)
    watch = Watch(folder, "--source", "log.csv")
    with Logger(folder / "log.csv", what, PAUSE) as logger:
        time.sleep(1.0)
        watch.start()
        again = _frozen(watch, times)
        logger.finish()
        written = logger.written
    time.sleep(5.0)
    code = watch.interrupt()
    lost = written - watch.rows
    return {**_result(watch, again, code, what.planted, written), "rows_lost": lost}


def served(kind: str, folder: Path, times: int) -> dict[str, Any]:
    """Beside an OPC UA server or an MQTT broker that goes on."""
    rows = int((20.0 + (times + 1) * (FROZEN + AGAIN + 5.0)) / STEP)
    # A fault outlasts a standstill, whose rows are lost: servers keep one value.
    what, source = course(folder, rows, 250, 100), Served(kind, folder)
    watch, start = watched(folder, what, source)
    again = _frozen(watch, times)
    time.sleep(max(start + rows * STEP - time.time(), 0.0))
    code = watch.interrupt()
    source.kill()
    return _result(watch, again, code, what.at(start, STEP), start + rows * STEP)


def _frozen(watch: Watch, times: int) -> int:
    """How often rows were judged again after a standstill."""
    again = 0
    for _ in range(times):
        time.sleep(AGAIN)
        watch.stand_still(FROZEN)
        before, until = watch.rows, time.monotonic() + PATIENCE
        while time.monotonic() < until and watch.rows <= before:
            time.sleep(0.2)
        again += watch.rows > before
    return again


def _result(watch: Watch, again: int, code: int, planted: Any, end: float) -> dict[str, Any]:
    return {
        "tried": watch.stood_still,
        "survived": again if code == 0 else 0,
        "told_gaps": sum(e.episode.subject == "gap" for e in watch.events),
        **score.outcome(watch.events, planted, end, watch.said),
    }
