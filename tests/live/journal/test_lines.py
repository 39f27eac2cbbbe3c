"""Lines of JSON: whole ones, each event once."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path

import pytest
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal.refused import JournalRefused

from tests.hostile.texts import STEERING
from tests.live.journal.events import event, event_in, story
from tests.live.journal.test_killed import Commit, written_until_killed


def events_in(file: Path) -> list[object]:
    lines = file.read_bytes().split(b"\n")
    assert lines.pop() == b""
    return [event_in(json.loads(line)) for line in lines]


def commit_to(file: Path) -> tuple[int, Commit]:
    sink = LinesFile(file)
    count = file.read_bytes().count(b"\n")
    return count, partial(sink.commit, "abc", dated=True)


def test_each_event_once_and_half_a_line_is_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    sink = LinesFile(file)
    sink.commit("abc", story()[:2], None, dated=True)
    with pytest.raises(JournalRefused, match="another process"):
        LinesFile(file)
    sink.close()
    whole = file.read_bytes()
    file.write_bytes(whole + b'{"plant": "abc", "num')
    sink = LinesFile(file)
    assert file.read_bytes() == whole
    sink.commit("abc", story(), None, dated=True)
    sink.commit("abc", story(), None, dated=True)
    assert events_in(file) == story()
    with pytest.raises(JournalRefused, match="another event 4 of abc"):
        sink.commit("abc", [event(4), event(5)], None, dated=True)
    sink.commit("xyz", [event(4)], None, dated=True)
    assert len(events_in(file)) == 5
    file.rename(tmp_path / "events.1.jsonl")  # as logs are put away
    sink.commit("abc", [event(5)], None, dated=True)
    assert events_in(file) == [event(5)]
    sink.close()


def test_texts_steer_no_terminal_and_break_no_line(tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    sink = LinesFile(file)
    text = "".join(STEERING.values()) + "\n"
    sink.commit("abc", [event(1, text=text)], None, dated=False)
    sink.close()
    assert events_in(file) == [event(1, text=text)]
    assert file.read_text().count("\n") == 1
    assert file.read_text().rstrip("\n").isprintable()


@pytest.mark.parametrize(
    "content",
    [b"time,A.dp\n1,2\n", b"\n", b"[1]\n", b"\xff\n", b"[" * 9999 + b"\n", b"note", b'{"x'],
)
def test_a_file_of_something_else_is_left_alone(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "other"
    file.write_bytes(content)
    with pytest.raises(JournalRefused, match=r"line( 1)? is no event; name another file"):
        LinesFile(file)
    assert file.read_bytes() == content


def test_killed(tmp_path: Path) -> None:
    file = tmp_path / "events.jsonl"
    told = written_until_killed(partial(commit_to, file), 20)
    LinesFile(file).close()
    found = events_in(file)
    assert found == [event(n + 1) for n in range(len(found))]
    assert told <= len(found) <= told + 1
