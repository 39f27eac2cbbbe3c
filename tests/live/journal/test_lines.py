"""Lines of JSON: whole ones, each event once."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal.refused import JournalRefused

from tests.hostile.texts import STEERING
from tests.live.journal.events import event, event_in, story


def events_in(file: Path) -> list[object]:
    lines = file.read_bytes().split(b"\n")
    assert lines.pop() == b""
    return [event_in(json.loads(line)) for line in lines]


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
    for _ in range(2):
        sink.commit("abc", story(), None, dated=True)
    assert events_in(file) == story()
    with pytest.raises(JournalRefused, match="another event 4 of abc"):
        sink.commit("abc", [event(4), event(5)], None, dated=True)
    sink.commit("xyz", [event(4)], None, dated=True)
    assert len(events_in(file)) == 5
    file.rename(tmp_path / "events.1.jsonl")  # as logs are put away
    text = "".join(STEERING.values()) + "\n"  # it steers no terminal and breaks no line
    sink.commit("abc", [event(5, text=text)], None, dated=False)
    sink.close()
    assert events_in(file) == [event(5, text=text)]
    assert file.read_text().removesuffix("\n").isprintable()


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
