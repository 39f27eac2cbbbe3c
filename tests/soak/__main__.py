"""Faults that `rulec watch` survives: `python -m tests.soak [PART...] [--times N] --json -`.

Each part says how often something was done to the watch or to its source, how often it went on
(`went_on`), and how much was lost (`all_lost`) or told twice (`all_twice`) in the end: events by
their numbers, rows of a file, faults that were planted. `all_bad` counts tracebacks, and what would
steer a terminal. The disk needs root.
"""

import argparse
import json
import os
import pty
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from rulec_runtime.live.episode import Event

from tests.live.conftest import filled, mounted
from tests.live.sources.plant_server import free_port
from tests.live.sources.taking import mutated
from tests.soak import watching
from tests.soak.served import maps, write_play
from tests.soak.watching import LEAD, OFF, ON, Course, Logger, Watch, course, outcome, rows_in

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
    count, times_kept = watching.rows_of(folder / "killed.db")
    return {
        **done,
        "rows_lost": done["rows"] - count,
        "rows_twice": len(times_kept) - len(set(times_kept)),
        **watching.against_undisturbed(watch.events, quiet.events),
        **outcome(watch.events, what.planted, done["rows"], watch.said),
    }


def lines_killed(folder: Path, times: int) -> dict[str, Any]:
    """With `--events` and `--state`, two files that are written one after the other."""
    what, state = course(folder, _rows(times)), folder / "state"
    options = ("--source", "log.csv", "--events", "events.jsonl", "--state", state.name)
    watch = Watch(folder, *options, journal="")
    done = _killed(folder, times, watch, what, random.Random(2), lambda: rows_in(state)[0])
    found = watching.events_from(folder / "events.jsonl")
    balance = Counter[str]()
    for event in found:
        if event.episode.kind != "source":
            ended = event.what in ("ended", "withdrawn")
            balance[event.episode.id] += (event.what == "began") - ended
    return {
        **done,
        "rows_lost": done["rows"] - rows_in(state)[0],
        "episodes_without_end": sum(b > 0 for b in balance.values()),
        "episodes_ended_twice": sum(b < 0 for b in balance.values()),
        **outcome(found, what.planted, done["rows"], watch.said),
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
        **outcome(events, what.planted, said=watch.said),
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


AHEAD, STEP = 5.0, 0.2
"""Seconds before the first row, and from row to row."""
RECONNECTED = 90.0
"""Seconds that the watch has to be connected again."""


class Served:
    """A process that serves the plant and can be killed."""

    def __init__(self, kind: str, folder: Path) -> None:
        self.kind, self.folder, self.port = kind, folder, free_port()

    def start(self) -> None:
        words = (self.kind, str(self.port), str(self.folder / "play.json"))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.soak.served", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == b"up\n"

    def kill(self) -> None:
        self._process.kill()
        self._process.communicate()


def watched(folder: Path, what: Course, served: Served) -> tuple[Watch, float]:
    """A watch of a served plant, with a journal, and when its first row is due, s since 1970."""
    text = maps(served.kind, what, served.port, STEP)
    (folder / "map.yaml").write_text(text)
    start = time.time() + AHEAD
    write_play(folder / "play.json", what, start, STEP)
    served.start()
    watch = Watch(folder, "--source", served.kind, "--map", "map.yaml")
    watch.start()
    return watch, start


def killed(kind: str, folder: Path, times: int) -> dict[str, Any]:
    """An OPC UA server, or an MQTT broker with the client that publishes."""
    draw, what = random.Random(3), course(folder, 300 + 200 * times, 200, 100)
    served = Served(kind, folder)
    watch, start = watched(folder, what, served)

    def connections() -> int:
        """How often the journal says that the plant is read again."""
        return of_connection(watch.events)["read_again"]

    until = time.monotonic() + RECONNECTED
    while not watch.rows and time.monotonic() < until:
        time.sleep(0.2)
    reconnected, longest = 0, 0.0
    for _ in range(times):
        time.sleep(draw.uniform(1.0, 5.0))
        served.kill()
        known = connections()
        time.sleep(draw.uniform(0.0, 3.0))
        served.start()
        began = time.monotonic()
        while connections() <= known and time.monotonic() - began < RECONNECTED:
            time.sleep(0.1)
        reconnected += connections() > known
        longest = max(longest, time.monotonic() - began)
    time.sleep(5.0)
    end = time.time()
    code = watch.interrupt()
    served.kill()
    return {
        "tried": times,
        "survived": reconnected if code == 0 else 0,
        "longest_until_read_again": round(longest, 1),
        **of_connection(watch.events),
        **outcome(watch.events, what.at(start, STEP), end, watch.said),
    }


def of_connection(events: Sequence[Event]) -> dict[str, int]:
    """How often it was told that the plant is read no more, that it is again, and rows missing."""
    source = [e for e in events if e.episode.kind == "source"]
    count = Counter(e.what for e in source)
    gaps = sum(1 for e in source if e.episode.subject == "gap")
    return {"told_lost": count["began"], "read_again": count["ended"], "told_gaps": gaps}


STEERING = (b"\x1b]", b"\x07", b"\xe2\x80\xae", b"\x1b[2J", b"\x9b")
"""What the pieces put in hold, and no picture of ours."""
ROWS = LEAD + ON + OFF + 1


def growing_file(folder: Path, times: int) -> dict[str, Any]:
    """Mutated rows in a file; sound ones follow. The watch speaks to a terminal of its own."""
    what, shown = course(folder, ROWS), list[bytes]()
    (folder / "log.csv").write_bytes(b"".join(_mutated_rows(what, times)))
    ours, theirs = pty.openpty()
    watch = Watch(folder, "--source", "log.csv", shown=theirs)
    watch.start("--until-end")
    os.close(theirs)

    def read() -> None:
        with suppress(OSError):  # the other end is closed
            while data := os.read(ours, 65536):
                shown.append(data)

    reader = threading.Thread(target=read, daemon=True)
    reader.start()
    code = watch.ended(300)
    reader.join(5)
    os.close(ours)
    text, events = b"".join(shown), watch.events
    found = {e.episode.subject for e in events if e.what == "began"}
    return {
        "tried": times,
        "survived": times if code == 0 else 0,
        "tracebacks": text.count(b"Traceback"),
        "steering": sum(text.count(piece) for piece in STEERING),
        "shown_bytes": len(text),
        "faults": len(what.planted),
        "faults_lost": sum(f.fault not in found for f in what.planted),
        **watching.numbers(events),
    }


def _mutated_rows(what: Course, times: int) -> Iterator[bytes]:
    """A header, mutated rows, sound ones whose times begin anew."""
    draw = random.Random(9)
    yield (",".join(["time [s]", *what.titles]) + "\n").encode()
    for k in range(times):
        sound = ",".join([str(k), *what.rows[k % LEAD]]) + "\n"
        yield mutated(sound.encode(), draw)
    yield b"\n"
    for k, row in enumerate(what.rows):
        yield (",".join([str(2_000_000 + k), *row]) + "\n").encode()


PARTS: dict[str, tuple[Callable[[Path, int], dict[str, Any]], int]] = {
    "kill-journal": (journal_killed, 20),
    "kill-lines": (lines_killed, 20),
    "opcua": (partial(killed, "opcua"), 20),
    "mqtt": (partial(killed, "mqtt"), 20),
    "disk-journal": (full, 5),
    "mutated-file": (growing_file, 10_000),
}
"""Each with what it does, and how often."""


def main() -> int:
    """Run the parts one after the other; the machine form on standard output."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--times", type=int, metavar="N", help="default 20 of most parts")
    parser.add_argument("--keep", metavar="DIR", help="leave all files there")
    parser.add_argument("--json", metavar="FILE", help="machine form; - for standard output")
    options = parser.parse_args()
    if strangers := set(options.parts) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(strangers))}")
    form: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="rulec-soak-") as folder:
        for name in options.parts or PARTS:
            part, usual = PARTS[name]
            work = Path(options.keep or folder) / name
            work.mkdir(parents=True, exist_ok=True)
            begin = time.perf_counter()
            form[name] = watching.summed(part(work, options.times or usual))
            seconds = time.perf_counter() - begin
            print(f"{name}: {json.dumps(form[name])} ({seconds:.0f} s)", file=sys.stderr)
    text = json.dumps(form, indent=1)
    if options.json == "-":
        print(text)
    elif options.json:
        Path(options.json).write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
