"""A journal on a disk that can be read alone: the watch starts, goes on, and catches up."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from rulec_runtime.commands.watch_kept import KeptJournal, kept_journal
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.store import open_journal

from tests.live.journal.events import event


@contextmanager
def kept(folder: Path) -> Iterator[KeptJournal]:
    with ExitStack() as stack:
        yield kept_journal(str(folder / "journal.db"), "abc", None, stack, [])


def remounted(folder: Path, how: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{how}", str(folder)], check=True)


def numbers(folder: Path) -> list[int]:
    journal = open_journal(str(folder / "journal.db"), make=False)
    found = [entry.event.number for entry in journal.events("abc")]
    journal.close()
    return found


@pytest.mark.parametrize("before", [0, 1, 2])
def test_it_starts_goes_on_and_catches_up(
    small_disk: Path,
    tmp_path: Path,
    before: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """With what was kept `before`: nothing, an event, two by a process that was killed."""
    monkeypatch.setattr(limits, "LAST_RETRY", 0.2)
    states, said = [], ""
    if before:
        elsewhere = open_journal(str(tmp_path / "journal.db"))
        for number in range(1, before + 1):
            elsewhere.commit("abc", [event(number)], f"state {number}".encode())
        elsewhere.release("abc")
        if before == 1:
            elsewhere.close()
        for file in tmp_path.glob("journal.db*"):  # beside an open one stands what it owes
            shutil.copy(file, small_disk)
        elsewhere.close()
    remounted(small_disk, "ro")
    with kept(small_disk) as journal:
        saved = journal.saved()
        states.append(None if saved is None else saved[0])
        journal.sink.put([event(before + 1)], b"later", dated=True)
        journal.sink.put([event(before + 2)], b"latest", dated=True)
        until = time.monotonic() + 10.0
        while "are kept" not in (said := said + capsys.readouterr().err):
            assert time.monotonic() < until
            time.sleep(0.02)
        remounted(small_disk, "rw")
    assert states == [f"state {before}".encode() if before else None]
    assert numbers(small_disk) == list(range(1, before + 3))
    said += capsys.readouterr().err
    assert said.count("events are kept and written when it works again") == 1
    assert "written again after" in said
