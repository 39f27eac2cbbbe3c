"""A disk that is full or can be read alone: the watch goes on, and owes nothing afterwards."""

import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

import pytest
from rulec_runtime.commands.watch_opened import BufferedFiles, buffered_journal
from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.store import open_journal

from tests.live.conftest import filled
from tests.live.journal.events import event, events_in, stored_in


@contextmanager
def buffered(
    folder: Path, waiting: Path | None = None, state: bool = True
) -> Iterator[tuple[BufferedFiles, list[str]]]:
    """Files of a watch, and what could not be written in the end."""
    unwritten: list[str] = []
    with ExitStack() as stack:
        where = str(folder / "state") if state else None
        events = str(folder / "events.jsonl")
        yield BufferedFiles((events, where), "abc", waiting, stack, unwritten), unwritten


def put(files: BufferedFiles, number: int, dated: bool = True) -> Event:
    """One more event, with the state behind it."""
    new = event(number)
    files.sink.put([new], f"state {number}".encode(), dated=dated)
    return new


def test_full_and_free_again(small_disk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each is on the disk before the next while there is room. Told once that there is none; then
    all is there, each once, no half line: in a new file where the old one was put away."""
    file, old, state = (small_disk / name for name in ("events.jsonl", "old.jsonl", "state"))
    with buffered(small_disk) as (files, unwritten):
        events = []
        for number in range(1, 4):
            events.append(put(files, number))
            assert events_in(file) == events
            assert state.read_bytes() == f"state {number}".encode()
        ballast = filled(small_disk)
        events += [put(files, n) for n in range(4, 40)]
        before = events_in(file)
        assert len(before) < 20
        file.rename(old)
        events.append(put(files, 40))
        ballast.unlink()
    assert unwritten == []
    assert events_in(old) == before
    assert [*before, *events_in(file)] == events
    assert state.read_bytes() == b"state 40"
    full, free = capsys.readouterr().err.splitlines()
    # Which file meets the full disk first is up to the file system.
    assert re.search(r"small/(state|events\.jsonl): No space left on device; events are kept", full)
    assert "written again after" in free
    assert not list(small_disk.glob("*.waiting.json"))


@pytest.mark.parametrize(("state", "dated"), [(True, False), (False, True)])
def test_ended_while_it_is_full(
    state: bool, dated: bool, small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits stands in the folder that is named; the next watch goes on behind it, also where
    some of it is in the file by now."""
    monkeypatch.setattr(limits, "BUSY", 0.3)
    waiting, file = tmp_path / "waits", small_disk / "events.jsonl"
    waiting.mkdir()
    with buffered(small_disk, waiting, state) as (files, unwritten):
        events = [put(files, 1, dated)]
        ballast = filled(small_disk)
        events += [put(files, n, dated) for n in range(2, 40)]
    assert "stands in" in unwritten[0]
    ballast.unlink()
    with buffered(small_disk, waiting, state) as (files, unwritten):
        latest = [data for data, _ in files.saved()][-1:]
        assert latest == ([b"state 39"] if state else [])
        put(files, 39, dated)  # as it is judged again where no state is kept
        events.append(put(files, 40, dated))
    assert unwritten == []
    assert events_in(file) == events
    assert list(waiting.iterdir()) == []


def remounted(folder: Path, how: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{how}", str(folder)], check=True)


@pytest.mark.parametrize(("before", "full"), [(0, False), (1, False), (2, False), (1, True)])
def test_a_journal_on_such_a_disk(
    small_disk: Path,
    tmp_path: Path,
    before: int,
    full: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With what waits beside it: memory has it. The watch starts, goes on and catches up, with what
    was kept `before`: nothing, an event, two by a process that was killed."""
    monkeypatch.setattr(limits, "LAST_RETRY", 0.2)
    if before:
        with closing(open_journal(str(tmp_path / "journal.db"))) as elsewhere:
            for number in range(1, before + 1):
                elsewhere.commit("abc", [event(number)], f"state {number}".encode())
            elsewhere.release("abc")
            if before == 1:
                elsewhere.close()
            for file in tmp_path.glob("journal.db*"):  # beside an open one stands what it owes
                shutil.copy(file, small_disk)
    if not full:
        remounted(small_disk, "ro")
    where, said, number = str(small_disk / "journal.db"), "", before
    with ExitStack() as stack:
        journal = buffered_journal(where, "abc", None, stack, [])
        saved = journal.saved()
        if full:
            filled(small_disk)
        while "are kept" not in said:
            number += 1
            assert number < 1000
            journal.sink.put([event(number)], f"state {number}".encode(), dated=True)
            time.sleep(0.01)
            said += capsys.readouterr().err
        (small_disk / "ballast").unlink() if full else remounted(small_disk, "rw")
    assert (saved and saved[0]) == (f"state {before}".encode() if before else None)
    with closing(open_journal(where, make=False)) as found:
        assert [e.event for e in found.events("abc")] == [event(n + 1) for n in range(number)]
        assert stored_in(found) == (number, f"state {number}".encode())
    said += capsys.readouterr().err
    assert said.count("events are kept and written when it works again") == 1
    assert "written again after" in said
