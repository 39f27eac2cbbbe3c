"""`kill -9` of the watch at random moments, beside a logger that writes on."""

import random
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.soak import score
from tests.soak.plant import Course, Logger, course
from tests.soak.watching import Watch

PAUSE = 0.05  # s from row to row
LONGEST = 4.0  # s that it is left alone at most after it went on
STARTING = 1.5  # s within which every second restart is killed as well
ROUND = 30.0  # s that a kill and what follows take at most, as an average
PATIENCE = 120.0  # s that a restart has to read on, also on a busy machine


def journal_killed(folder: Path, times: int) -> dict[str, Any]:
    """With `--journal`: against a watch beside it that nobody kills."""
    watch, quiet = (
        Watch(folder, "--source", "log.csv", journal=f"{name}.db") for name in ("killed", "quiet")
    )
    what = course(folder, _rows(times))
    done = _killed(folder, times, watch, what, random.Random(1), lambda: watch.rows, quiet)
    time.sleep(2.0)
    quiet.interrupt()
    count, times_kept = score.rows_of(folder / "killed.db")
    return {
        **done,
        "rows_lost": done["rows"] - count,
        "rows_twice": len(times_kept) - len(set(times_kept)),
        **score.against_undisturbed(watch.events, quiet.events),
        **score.outcome(watch.events, what.planted, done["rows"], watch.said),
    }


def lines_killed(folder: Path, times: int) -> dict[str, Any]:
    """With `--events` and `--state`, two files that are written one after the other."""
    what, state = course(folder, _rows(times)), folder / "state"
    options = ("--source", "log.csv", "--events", "events.jsonl", "--state", state.name)
    watch = Watch(folder, *options, journal="")
    done = _killed(folder, times, watch, what, random.Random(2), lambda: score.rows_in(state)[0])
    found = score.events_from(folder / "events.jsonl")
    balance = Counter[str]()
    for event in found:
        if event.episode.kind != "source":
            ended = event.what in ("ended", "withdrawn")
            balance[event.episode.id] += (event.what == "began") - ended
    return {
        **done,
        "rows_lost": done["rows"] - score.rows_in(state)[0],
        "episodes_without_end": sum(b > 0 for b in balance.values()),
        "episodes_ended_twice": sum(b < 0 for b in balance.values()),
        **score.outcome(found, what.planted, done["rows"], watch.said),
    }


def _rows(times: int) -> int:
    """More than are written: the logger ends behind the last kill."""
    return int(times * ROUND / PAUSE) + 300


def _killed(
    folder: Path,
    times: int,
    watch: Watch,
    what: Course,
    draw: random.Random,
    rows: Callable[[], int],
    beside: Watch | None = None,
) -> dict[str, int]:
    """Kill a watch, not the one `beside` it, and start it again; each restart counts alone: has it
    read rows beyond those before the kill? None has survived if the last one does not end well."""
    done = {"tried": times, "killed": 0, "killed_starting": 0, "survived": 0}
    with Logger(folder / "log.csv", what, PAUSE) as logger:
        time.sleep(1.0)
        if beside is not None:
            beside.start()
        watch.start()
        for _ in range(times):
            time.sleep(draw.uniform(0.0, LONGEST))
            done["killed"] += watch.runs
            watch.kill()
            if draw.random() < 0.5:
                watch.start()
                time.sleep(draw.uniform(0.0, STARTING))
                done["killed_starting"] += watch.runs
                watch.kill()
            before = rows()
            watch.start()
            done["survived"] += _went_on(watch, rows, before)
        logger.finish()
        done["rows"] = logger.written
    watch.kill()
    watch.start("--until-end")
    if watch.ended() != 0:
        done["survived"] = 0
    return done


def _went_on(watch: Watch, rows: Callable[[], int], before: int) -> bool:
    """Does it read rows within its patience?"""
    until = time.monotonic() + PATIENCE
    while watch.runs and time.monotonic() < until:
        if rows() > before:
            return True
        time.sleep(0.5)
    return False
