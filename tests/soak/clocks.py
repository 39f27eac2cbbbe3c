"""The clock of the source jumps: forward while nothing is wrong, back within a fault, and again."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

from rulec_runtime.live.episode import Event

from tests.soak import score
from tests.soak.plant import LEAD, OFF, ON, Logger, course
from tests.soak.sources import STEP, Served, watched
from tests.soak.watching import Watch

HOUR = 3600.0
ROWS = LEAD + 5 * (ON + OFF) + 10
JUMPS = (
    (LEAD + ON + OFF // 2, HOUR),
    (LEAD + 2 * (ON + OFF) + ON // 2, -HOUR),
    (LEAD + 3 * (ON + OFF) + ON // 2, HOUR),
)
"""From which row on, by how many s."""
PAUSE = 0.05


def seconds(folder: Path, times: int) -> dict[str, Any]:
    """A growing file with times in seconds."""
    return _logged(folder, None)


def dates(folder: Path, times: int) -> dict[str, Any]:
    """A growing file with dates, an hour and more ago."""
    return _logged(folder, time.time() - 3 * HOUR)


def _logged(folder: Path, since: float | None) -> dict[str, Any]:
    what = course(folder, ROWS)
    watch = Watch(folder, "--source", "log.csv", "--journal", "journal.db")
    with Logger(folder / "log.csv", what, PAUSE, JUMPS, since) as logger:
        time.sleep(1.0)
        watch.start()
        logger.over.wait()
    time.sleep(5.0)
    found = _result(folder, watch, watch.interrupt(), what.planted, ROWS)
    return {**found, "rows_lost": found["rows"] - found["rows_judged"]}


def served(kind: str, folder: Path, times: int) -> dict[str, Any]:
    """Stamps of an OPC UA server, or of MQTT messages."""
    what, source = course(folder, ROWS), Served(kind, folder)
    watch, start = watched(folder, what, source, lead=2.0, jumps=JUMPS)
    time.sleep(max(start + (ROWS - 2) * STEP - time.time(), 0.0))
    code = watch.interrupt()
    source.kill()
    return _result(folder, watch, code, what.planted, ROWS)


def _result(folder: Path, watch: Watch, code: int, planted: Any, rows: int) -> dict[str, Any]:
    events = score.events_of(folder / "journal.db")
    return {
        "tried": len(JUMPS),
        "survived": len(JUMPS) if code == 0 else 0,
        "told": _told(events, "clock"),
        "alarms": _told(events, "stale"),
        "rows": rows,
        "rows_judged": score.rows_of(folder / "journal.db")[0],
        **score.by_name(events, planted),
        **score.numbers(e.number for e in events),
        **score.bad_output(watch.out + watch.err),
    }


def _told(events: list[Event], subject: str) -> int:
    return sum(1 for e in events if e.episode.subject == subject and e.what != "ended")
