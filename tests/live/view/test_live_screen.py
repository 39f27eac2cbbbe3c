"""The terminal beside the plant: kept up to date, ended by a key; lines where nobody watches."""

from __future__ import annotations

import io
import os
import pty
import re
import time
from collections.abc import Callable
from dataclasses import replace

import pytest
from rulec_runtime.live.now import Arrival, Now
from rulec_runtime.live.view import live_screen
from rulec_runtime.live.view.keys import Keys
from rulec_runtime.live.view.live_screen import LiveScreen
from rulec_runtime.output.terminal import Terminal

from tests.live.view.hostile import TEXTS, hostile
from tests.live.view.nows import failing, leaking

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def nobody(_: str, __: str) -> None:
    """Takes note of nothing."""


def waited_for(true: Callable[[], bool]) -> bool:
    until = time.monotonic() + 5.0
    while not true() and time.monotonic() < until:
        time.sleep(0.01)
    return true()


def test_operator_acknowledges_and_quits() -> None:
    ours, theirs = pty.openpty()
    out, asked = io.StringIO(), list[tuple[str, str]]()
    console = Terminal(file=out, width=80, height=24, force_terminal=True)
    now = failing()
    with LiveScreen(lambda *a: asked.append(a), console, Keys(theirs)) as live:
        live.show(now)
        os.write(ours, b"\x1b[Ba?")
        assert waited_for(lambda: "letters of NAMUR NE 107" in out.getvalue())
        assert not live.quit
        os.write(ours, b"q")
        assert waited_for(lambda: live.quit)
    assert [(now.active[1].id, live_screen.who())] == asked
    assert live_screen.who().endswith("terminal")
    text = out.getvalue()
    assert "\x1b[?1049h" in text
    behind = text.rpartition("\x1b[?1049l")[2]
    assert "✖ F failure: B.dp is stuck at 1.82294 bar" in ESCAPES.sub("", behind)
    for end in (ours, theirs):
        os.close(end)


def test_pictures_are_few_however_many_rows_come() -> None:
    out = io.StringIO()
    console = Terminal(file=out, width=80, height=24, force_terminal=True)
    rows = [replace(leaking(), rows=i) for i in range(1000)]
    since = time.monotonic()
    with LiveScreen(nobody, console, _none()) as live:
        begin = time.thread_time()
        for now in rows:
            live.show(now)
        # A picture costs some 20 ms; who shows rows draws none of them.
        assert time.thread_time() - begin < 1.0
        assert waited_for(lambda: "A.leakage" in out.getvalue())
    # However long other work on the machine makes this last.
    assert out.getvalue().count("modules") <= 3 + (time.monotonic() - since) / live_screen.TICK


def test_mistake_in_a_picture_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(live_screen, "Screen", broken)
    console = Terminal(file=io.StringIO(), width=80, height=24, force_terminal=True)
    live = LiveScreen(nobody, console, _none())
    with live:
        live.show(leaking())
        assert waited_for(lambda: live.failed)
        with pytest.raises(ZeroDivisionError):
            live.show(leaking())


def test_pipe_gets_every_event_once_in_order() -> None:
    now = leaking()
    out = io.StringIO()
    with LiveScreen(nobody, Terminal(file=out, width=40)) as live:
        live.show(replace(now, past=now.past[2:]))
        live.show(now)
        live.show(now)
    told = "    since {}; do: check the bypass valve, then the clearance of the pump"
    assert out.getvalue().splitlines() == [
        "2026-09-21 16:13:31  ◆ M  began A.leakage 0.200",
        told.format("2026-09-21 16:13:31"),
        "2026-09-21 16:13:39  ✓  ended A.leakage 0.200",
        "2026-09-21 16:13:51  ◆ M  began A.leakage 0.399",
        told.format("2026-09-21 16:13:51"),
        "2026-09-21 16:13:59  ✓  ended A.leakage 0.399",
        "2026-09-21 16:14:11  ◆ M  began A.leakage 0.600",
        told.format("2026-09-21 16:14:11"),
    ]


def test_events_that_are_gone_are_told_as_missing_and_old_ones_not_again() -> None:
    out = io.StringIO()
    with LiveScreen(nobody, Terminal(file=out, width=80), told=2) as live:
        live.show(replace(leaking(), past=leaking().past[:2]))
    assert "1 events in between" in out.getvalue()
    assert 4 == len(out.getvalue().splitlines())


def test_dumb_terminal_gets_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "dumb")
    out = io.StringIO()
    with LiveScreen(nobody, Terminal(file=out, width=80, force_terminal=True)) as live:
        live.show(leaking())
    assert 8 == len(out.getvalue().splitlines())
    assert "\x1b" not in out.getvalue()


@pytest.mark.parametrize("text", TEXTS, ids=repr)
def test_hostile_event_stays_on_its_lines(text: str) -> None:
    now: Now = hostile(text)
    out = io.StringIO()
    with LiveScreen(nobody, Terminal(file=out, width=80)) as live:
        live.show(now)
    lines = out.getvalue().split("\n")
    advised = sum(event.what == "began" and event.episode.action != "" for event in now.past)
    assert len(now.past) + advised + 1 == len(lines)
    assert "\x1b" not in out.getvalue()


def test_age_is_that_of_the_last_row() -> None:
    arrival = Arrival()
    assert arrival.age(5.0) is None
    for rows, time_ in ((3, 10.0), (3, 12.0), (4, 13.0), (4, 14.0)):
        arrival.saw(rows, time_)
    assert 2.0 == arrival.age(15.0)


def _none() -> Keys:
    """No keys: a descriptor that is no terminal."""
    return Keys(os.open(os.devnull, os.O_RDONLY))
