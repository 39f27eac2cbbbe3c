"""`kill -9` while it writes: nothing lost of what was told as written, nothing twice."""

from __future__ import annotations

import multiprocessing
import os
import random
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal.store import open_journal

from tests.live.journal.events import event, kept_in
from tests.live.journal.test_lines import events_in

Commit = Callable[[Sequence[Event], bytes], None]


def written_until_killed(opened: Callable[[], tuple[int, Commit]], times: int) -> int:
    """Kill a writer at random moments; the number of the last event that it told as written.

    `opened` gives the number of the last event that is there, and what writes more.
    """
    last = 0
    for _ in range(times):
        ours, theirs = multiprocessing.Pipe(duplex=False)
        child = multiprocessing.get_context("fork").Process(target=_write, args=(opened, theirs))
        child.start()
        theirs.close()
        assert ours.poll(20), "the writer writes nothing"
        time.sleep(random.uniform(0.0, 0.03))
        assert child.pid is not None
        os.kill(child.pid, signal.SIGKILL)
        child.join()
        while True:
            try:
                last = max(last, ours.recv())
            except EOFError:
                break
        ours.close()
    return last


def _write(opened: Callable[[], tuple[int, Commit]], told: Connection) -> None:
    last, commit = opened()
    for number in range(last + 1, last + 10_000):
        # The event before comes again, as after a kill between writing and telling.
        commit([event(n) for n in (number - 1, number) if n > 0], str(number).encode())
        told.send(number)


def journal_at(where: str) -> tuple[int, Commit]:
    """A journal as a watcher that starts again finds it."""
    journal = open_journal(where)
    journal.hold("abc")  # at once, though the one before was killed
    return journal.last("abc"), partial(journal.commit, "abc")


def lines_in(file: Path) -> tuple[int, Commit]:
    sink = LinesFile(file)
    return file.read_bytes().count(b"\n"), partial(sink.commit, "abc", dated=True)


def check(found: Sequence[object], told: int) -> None:
    assert found == [event(n + 1) for n in range(len(found))]
    assert told <= len(found) <= told + 1  # killed between writing and telling


def test_journal(where: str) -> None:
    told = written_until_killed(partial(journal_at, where), 5 if "postgres" in where else 20)
    with closing(open_journal(where)) as journal:
        found = [entry.event for entry in journal.events("abc")]
        check(found, told)
        number, state = kept_in(journal)
    assert number == int(state) == len(found)


def test_lines(tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    told = written_until_killed(partial(lines_in, file), 20)
    LinesFile(file).close()
    check(events_in(file), told)
