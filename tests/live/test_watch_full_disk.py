"""Events and state in files on a full disk: the watch goes on, and owes nothing afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest
from rulec_runtime.commands.watch_kept import KeptFiles, kept_files
from rulec_runtime.live.episode import Event
from rulec_runtime.live.journal import limits
from rulec_runtime.live.journal.refused import JournalRefused

from tests.live.journal.events import event
from tests.live.journal.test_lines import events_in


@contextmanager
def kept(
    folder: Path, waiting: Path | None = None, state: bool = True
) -> Iterator[tuple[KeptFiles, list[str]]]:
    """Files of a watch, and what could not be written in the end."""
    unwritten: list[str] = []
    with ExitStack() as stack:
        where = str(folder / "state") if state else None
        events = str(folder / "events.jsonl")
        files = kept_files(events, where, "abc", waiting, stack, unwritten)
        assert files is not None
        yield files, unwritten


def put(files: KeptFiles, number: int, dated: bool = True) -> Event:
    """One more event, with the state behind it."""
    new = event(number)
    files.sink.put([new], f"state {number}".encode(), dated=dated)
    return new


def filled(disk: Path) -> Path:
    """A file that takes all the room there is."""
    ballast = disk / "ballast"
    with suppress(OSError), ballast.open("ab", buffering=0) as file:
        piece = 1 << 16
        while piece:
            try:
                file.write(bytes(piece))
            except OSError:
                piece //= 2
    return ballast


def test_each_is_on_the_disk_before_the_next(tmp_path: Path) -> None:
    with kept(tmp_path) as (files, _):
        for number in range(1, 6):
            put(files, number)
            assert len(events_in(tmp_path / "events.jsonl")) == number
            assert (tmp_path / "state").read_bytes() == f"state {number}".encode()


def test_full_and_free_again(small_disk: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Told once; then all is there, each once, no half line."""
    file = small_disk / "events.jsonl"
    with kept(small_disk) as (files, unwritten):
        told = [put(files, 1)]
        ballast = filled(small_disk)
        told += [put(files, n) for n in range(2, 40)]
        before = events_in(file)
        assert before == told[: len(before)]
        assert len(before) < 20
        ballast.unlink()
        told.append(put(files, 40))
    assert unwritten == []
    assert events_in(file) == told
    assert (small_disk / "state").read_bytes() == b"state 40"
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert "No space left" in said[0]
    assert "written again after" in said[1]
    assert not list(small_disk.glob("*.waiting.json"))


@pytest.mark.parametrize("dated", [True, False])
@pytest.mark.parametrize("state", [True, False])
def test_ended_while_it_is_full(
    state: bool, dated: bool, small_disk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits stands in the folder that is named; the next watch goes on behind it, also where
    some of it is in the file by now."""
    monkeypatch.setattr(limits, "BUSY", 0.3)
    waiting, file = tmp_path / "waits", small_disk / "events.jsonl"
    waiting.mkdir()
    with kept(small_disk, waiting, state) as (files, unwritten):
        told = [put(files, 1, dated)]
        ballast = filled(small_disk)
        told += [put(files, n, dated) for n in range(2, 40)]
    assert "stands in" in unwritten[0]
    ballast.unlink()
    with kept(small_disk, waiting, state) as (files, unwritten):
        latest = [data for data, _ in files.saved()][-1:]
        assert latest == ([b"state 39"] if state else [])
        assert files.ahead(39) == []
        put(files, 39, dated)  # as it is judged again where no state is kept
        told.append(put(files, 40, dated))
    assert unwritten == []
    assert events_in(file) == told
    assert list(waiting.iterdir()) == []


def test_moved_away_while_it_is_full(small_disk: Path) -> None:
    """As logs are put away: what waits goes into the new file."""
    file = small_disk / "events.jsonl"
    with kept(small_disk) as (files, _):
        put(files, 1)
        ballast = filled(small_disk)
        waited = [put(files, n) for n in range(2, 40)]
        written = len(events_in(file))
        file.rename(small_disk / "events.1.jsonl")
        waited.append(put(files, 40))
        ballast.unlink()
    assert events_in(file) == waited[written - 1 :]


def test_no_such_folder(tmp_path: Path) -> None:
    with pytest.raises(JournalRefused, match="there is no such folder"), kept(tmp_path / "none"):
        pass
