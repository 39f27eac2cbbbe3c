"""The terminal beside the plant: kept up to date, ended by a key; lines where nobody watches."""

from __future__ import annotations

import io
import os
import pty
import re
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import pytest
from rulec_runtime.live.moment import Arrival
from rulec_runtime.live.view import live_screen
from rulec_runtime.live.view.live_screen import Keys, LiveScreen
from rulec_runtime.output.terminal import Terminal

from tests.conftest import SOURCES
from tests.live.test_watch import until
from tests.live.view.hostile import TEXTS, hostile
from tests.live.view.nows import failing, leaking

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def nobody(_: str, __: str) -> None:
    """Takes note of nothing."""


def terminal(out: io.StringIO) -> Terminal:
    return Terminal(file=out, width=80, height=24, force_terminal=True)


def test_operator_acknowledges_and_quits() -> None:
    ours, theirs = pty.openpty()
    out, asked, now = io.StringIO(), list[tuple[str, str]](), failing()
    with LiveScreen(lambda *a: asked.append(a), terminal(out), Keys(theirs)) as live:
        live.show(now)
        os.write(ours, b"\x1b[Ba?")
        until(lambda: "letters of NAMUR NE 107" in out.getvalue())
        assert not live.quit
        os.write(ours, b"q")
        until(lambda: live.quit)
    assert [(now.active[1].id, live_screen.who())] == asked
    assert live_screen.who().endswith("terminal")
    before, _, behind = out.getvalue().rpartition("\x1b[?1049l")
    assert "\x1b[?1049h" in before
    assert "✖ F failure: B.dp is stuck at 1.82294 bar" in ESCAPES.sub("", behind)
    for end in (ours, theirs):
        os.close(end)


def test_pictures_are_few_however_many_rows_come() -> None:
    out = io.StringIO()
    rows = [replace(leaking(), rows=i) for i in range(1000)]
    since = time.monotonic()
    with LiveScreen(nobody, terminal(out), _none()) as live:
        begin = time.thread_time()
        for now in rows:
            live.show(now)
        # A picture costs some 20 ms; who shows rows draws none of them.
        assert time.thread_time() - begin < 1.0
        until(lambda: "A.leakage" in out.getvalue())
    # However long other work on the machine makes this last.
    assert out.getvalue().count("modules") <= 3 + (time.monotonic() - since) / live_screen.TICK


def test_mistake_in_a_picture_is_not_hidden(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(live_screen, "Screen", broken)
    with LiveScreen(nobody, terminal(io.StringIO()), _none()) as live:
        live.show(leaking())
        until(lambda: live.failed)
        with pytest.raises(ZeroDivisionError):
            live.show(leaking())


def test_lines_tell_every_event_once_in_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a pipe and a dumb terminal; what is gone is told as missing, what was told not again."""
    now, out = leaking(), io.StringIO()
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
    monkeypatch.setenv("TERM", "dumb")
    out = io.StringIO()
    with LiveScreen(nobody, terminal(out), told=2) as live:
        live.show(replace(now, past=now.past[:2]))
    assert "1 events in between" in out.getvalue()
    assert 4 == len(out.getvalue().splitlines())
    assert "\x1b" not in out.getvalue()


@pytest.mark.parametrize("text", TEXTS, ids=repr)
def test_hostile_event_stays_on_its_lines(text: str) -> None:
    now, out = hostile(text), io.StringIO()
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


@pytest.fixture
def ends() -> Iterator[tuple[int, int]]:
    """Both ends of a terminal."""
    both = pty.openpty()
    yield both
    for end in both:
        with suppress(OSError):
            os.close(end)


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        (b"\x1b[A\x1b[B\x1bOA\x1bOBkj", ["up", "down"] * 3),
        (b"\rap?q", ["enter", "acknowledge", "past", "help", "quit"]),
        (b"\x1b[15~\x1b[1;5C\x1b[3~z\xff\xc3\xa9", []),
        (b"\x1b[<0;1;1Mq", ["quit"]),
    ],
)
def test_keys_have_names(ends: tuple[int, int], sent: bytes, keys: list[str]) -> None:
    with Keys(ends[1]) as pressed:
        os.write(ends[0], sent)
        assert keys == pressed.take(0.05)


def test_sequences_in_two_parts(ends: tuple[int, int]) -> None:
    with Keys(ends[1]) as pressed:
        os.write(ends[0], b"\x1b")
        assert [] == pressed.take(0.05)
        os.write(ends[0], b"[A")
        assert ["up"] == pressed.take(0.05)
        os.write(ends[0], b"\x1b")
        assert [[], ["back"]] == [pressed.take(0.05), pressed.take(0.01)]


def test_terminal_is_given_back_and_may_go_away(ends: tuple[int, int]) -> None:
    before = termios.tcgetattr(ends[1])
    with suppress(ValueError), Keys(ends[1]):
        during = termios.tcgetattr(ends[1])
        raise ValueError("odd")
    assert not during[3] & (termios.ICANON | termios.ECHO)
    assert during[3] & termios.ISIG
    assert before == termios.tcgetattr(ends[1])
    with Keys(ends[1]) as pressed:
        os.close(ends[0])
        assert [] == pressed.take(0.05)
        assert not pressed.there


def test_no_terminal_no_keys() -> None:
    program = (
        "from rulec_runtime.live.view.live_screen import Keys\n"
        "with Keys() as keys: print(keys.there, keys.take(0.01))"
    )
    told = subprocess.check_output(
        [sys.executable, "-c", program],
        stdin=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONPATH": SOURCES},
        start_new_session=True,
    )
    assert "False []\n" == told
