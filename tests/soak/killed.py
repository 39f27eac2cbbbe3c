"""`kill -9` of the watch at random moments, beside a logger that writes on."""

from __future__ import annotations

import random
import time
from pathlib import Path
from typing import Any

from tests.soak import score
from tests.soak.plant import Logger, course
from tests.soak.watching import Watch

PAUSE = 0.05  # s from row to row
LONGEST = 4.0  # s that one life lasts at most


def journal_killed(folder: Path, times: int) -> dict[str, Any]:
    """With `--journal`: against a watch beside it that nobody kills."""
    rows = int(times * (LONGEST / 2 + 0.5) / PAUSE) + 300
    draw, what = random.Random(1), course(folder, rows)
    log = folder / "log.csv"
    watch = Watch(folder, "--source", "log.csv", "--journal", "killed.db", name="killed")
    quiet = Watch(folder, "--source", "log.csv", "--journal", "quiet.db", name="quiet")
    done = {"tried": times, "killed": 0}
    with Logger(log, what, PAUSE) as logger:
        time.sleep(1.0)
        quiet.start()
        for _ in range(times):
            watch.start()
            time.sleep(draw.uniform(0.0, LONGEST))
            done["killed"] += watch.runs
            watch.kill()
        logger.over.wait()
    watch.start("--until-end")
    code = watch.ended()
    time.sleep(2.0)
    quiet.interrupt()
    events = score.events_of(folder / "killed.db")
    count, times_kept = score.rows_of(folder / "killed.db")
    return {
        **done,
        "survived": times if code == 0 else 0,
        "rows": rows,
        "rows_lost": rows - count,
        "rows_twice": len(times_kept) - len(set(times_kept)),
        "events": len(events),
        **score.numbers(e.number for e in events),
        **score.against_undisturbed(events, score.events_of(folder / "quiet.db")),
        **score.against_plant(events, what.planted),
        **score.bad_output(watch.out + watch.err),
    }


def lines_killed(folder: Path, times: int) -> dict[str, Any]:
    """With `--events` and `--state`, two files that are written one after the other."""
    rows = int(times * (LONGEST / 2 + 0.5) / PAUSE) + 300
    draw, what = random.Random(2), course(folder, rows)
    options = ("--source", "log.csv", "--events", "events.jsonl", "--state", "state")
    watch = Watch(folder, *options)
    done = {"tried": times, "killed": 0}
    with Logger(folder / "log.csv", what, PAUSE) as logger:
        time.sleep(1.0)
        for _ in range(times):
            watch.start()
            time.sleep(draw.uniform(0.0, LONGEST))
            done["killed"] += watch.runs
            watch.kill()
        logger.over.wait()
    watch.start("--until-end")
    code = watch.ended()
    found = score.events_in(folder / "events.jsonl")
    balance = [
        sum((e["what"] == "began") - (e["what"] in ("ended", "withdrawn")) for e in part)
        for part in _by_episode(found)
    ]
    return {
        **done,
        "survived": times if code == 0 else 0,
        "events": len(found),
        **score.numbers(e["number"] for e in found),
        "episodes_without_end": sum(b > 0 for b in balance),
        "episodes_ended_twice": sum(b < 0 for b in balance),
        **score.forms_against_plant(found, what.planted),
        **score.bad_output(watch.out + watch.err),
    }


def _by_episode(found: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    parts: dict[str, list[dict[str, Any]]] = {}
    for event in found:
        if event["episode"]["kind"] != "source":
            parts.setdefault(event["episode"]["id"], []).append(event)
    return list(parts.values())
