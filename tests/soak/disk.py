"""A disk that is full for a while, and a database that is gone: nothing lost, nothing twice."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.live.journal.postgres import PROGRAMS, Postgres
from tests.soak import score
from tests.soak.plant import LEAD, OFF, ON, Logger, course
from tests.soak.watching import Watch

SIZE = "6m"
PAUSE = 0.05  # s from row to row
FULL = 4.0  # s that the disk is full: longer than a fault or the time between two
FREE = 4.0
GONE = 60.0  # s that the database is gone


JOURNAL = ("--journal", "small/journal.db")
LINES = ("--events", "small/events.jsonl", "--state", "small/state")


def full(folder: Path, times: int, options: tuple[str, ...], kills: int = 0) -> dict[str, Any]:
    """What `options` name is on the disk: the watch runs on. It is killed so often while the disk
    is full."""
    rows = int((times + 1) * (FULL + FREE) / PAUSE) + LEAD + ON + OFF
    what, small = course(folder, rows), folder / "small"
    with _disk(small) as there:
        if not there:
            return {"skipped": "mounting a small file system needs root"}
        watch = Watch(folder, "--source", "log.csv", *options)
        ran = 0
        with Logger(folder / "log.csv", what, PAUSE) as logger:
            time.sleep(1.0)
            watch.start()
            for _ in range(times):
                _alive(watch, FREE)
                _fill(small / "filler")
                for _ in range(kills):
                    time.sleep(FULL / (kills + 1))
                    watch.kill()
                    watch.start()
                time.sleep(FULL / (kills + 1))
                ran += watch.runs
                (small / "filler").unlink()
            while not logger.over.wait(0.5):
                _alive(watch, 0.0)
        if watch.runs:
            time.sleep(12.0)  # the journal is tried again within ten seconds
            watch.interrupt()
        watch.start("--until-end")
        code = watch.ended()
        if "--journal" in options:
            found = score.events_of(small / "journal.db")
            lost = {"rows": rows, "rows_lost": rows - score.rows_of(small / "journal.db")[0]}
        else:
            found = score.events_from(small / "events.jsonl")
            lost = {}
    return {
        "tried": times,
        "ran_on": ran,
        "starts": watch.lives,
        "survived": ran if code == 0 else 0,
        "events": len(found),
        **lost,
        **score.numbers(e.number for e in found),
        **score.against_plant(found, what.planted),
        **score.bad_output(watch.out + watch.err),
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


def _fill(path: Path) -> None:
    """Until nothing more fits in."""
    with path.open("wb", buffering=0) as out:
        piece = 1 << 16
        while piece:
            try:
                out.write(b"x" * piece)
            except OSError:
                piece //= 2


@contextmanager
def _disk(folder: Path) -> Iterator[bool]:
    folder.mkdir(exist_ok=True)
    words = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", str(folder)]
    mounted = subprocess.run(words, capture_output=True, check=False).returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=False)


def read_only(folder: Path, times: int) -> dict[str, Any]:
    """A journal on a disk that can be read alone for a while, from a kill and a start on."""
    rows = int((times + 1) * (FULL + FREE + 2.0) / PAUSE) + LEAD + ON + OFF
    what, small = course(folder, rows), folder / "small"
    with _disk(small) as there:
        if not there:
            return {"skipped": "mounting a small file system needs root"}
        watch, ran = Watch(folder, "--source", "log.csv", "--journal", "small/journal.db"), 0
        with Logger(folder / "log.csv", what, PAUSE) as logger:
            time.sleep(1.0)
            watch.start()
            for _ in range(times):
                _alive(watch, FREE)
                watch.kill()
                _remounted(small, "ro")
                watch.start()
                time.sleep(FULL)
                ran += watch.runs
                _remounted(small, "rw")
            logger.over.wait()
        time.sleep(12.0)
        code = watch.interrupt()
        found = score.events_of(small / "journal.db")
        count = score.rows_of(small / "journal.db")[0]
    return {
        "tried": times,
        "survived": ran if code == 0 else 0,
        "rows_lost": rows - count,
        **score.numbers(e.number for e in found),
        **score.against_plant(found, what.planted),
        **score.bad_output(watch.out + watch.err),
    }


def _remounted(folder: Path, how: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{how}", str(folder)], check=True)


def database(folder: Path, times: int) -> dict[str, Any]:
    """PostgreSQL stopped for a minute each time."""
    if not PROGRAMS:
        return {"skipped": "no server of PostgreSQL in /usr/lib/postgresql"}
    rows = int((30.0 + times * (GONE + 20.0)) / 0.2)
    what, server = course(folder, rows), Postgres()
    try:
        watch = Watch(folder, "--source", "log.csv", "--journal", server.url)
        ran = 0
        with Logger(folder / "log.csv", what, 0.2) as logger:
            time.sleep(1.0)
            watch.start()
            for _ in range(times):
                time.sleep(20.0)
                server.stop()
                time.sleep(GONE)
                ran += watch.runs
                server.start()
            logger.over.wait()
        time.sleep(15.0)
        watch.interrupt()
        watch.start("--until-end")
        code = watch.ended()
        events, count = score.events_of(server.url), score.rows_of(server.url)[0]
    finally:
        server.close()
    return {
        "tried": times,
        "ran_on": ran,
        "survived": ran if code == 0 else 0,
        "rows": rows,
        "rows_lost": rows - count,
        "events": len(events),
        **score.numbers(e.number for e in events),
        **score.against_plant(events, what.planted),
        **score.bad_output(watch.out + watch.err),
    }
