"""The terminal beside the plant: its picture, kept up to date, ended by a key, steered by no text;
lines where nobody watches."""

import io
import os
import pty
import re
import termios
import time
import unicodedata
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import pytest
from rich.cells import cell_len
from rulec_runtime.live import moment
from rulec_runtime.live.memory import nothing_yet
from rulec_runtime.live.moment import Now, Present
from rulec_runtime.live.view import live_screen
from rulec_runtime.live.view.live_screen import Keys, LiveScreen
from rulec_runtime.live.view.screen import Screen, View, ViewState, after
from rulec_runtime.live.view.words import listed
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.report.wording import STATUS

from tests.conftest import compiled
from tests.live.test_watch import until
from tests.live.view.nows import TEXTS, before, failing, healthy, hostile, leaking

VIEWS: tuple[View, ...] = ("plant", "explanation")


def nobody(_: str, __: str) -> None:
    """Takes note of nothing."""


def drawn(now: Now, state: ViewState | None = None, size: tuple[int, int] = (80, 24)) -> list[str]:
    """Lines without colour."""
    out = io.StringIO()
    console = Terminal(file=out, width=size[0], height=size[1])
    console.print(Screen(now, state or ViewState(), *size, age=3.2), end="")
    return out.getvalue().split("\n")


def text(now: Now, view: View = "plant", size: tuple[int, int] = (80, 24)) -> str:
    return "\n".join(drawn(now, ViewState(view=view), size))


def test_finding_comes_first_with_all_that_an_operator_needs() -> None:
    """Also where the diagnosis has forgotten its rows."""
    for part in (
        "◆ M maintenance required",
        "● connected: opc.tcp://plant.example:48",
        "last row 2026-09-21 16:14:19 (3 s ago)",
        "A ◆ M  B ✓ ok  C ✓ ok",
        "> ◆ M NEW A: the pump delivers 60 % less than its characteristic predicts",
        "A.leakage 0.600 (95 %: 0.596 to 0.604), since 16:14:11 (8 s)",
        "probability 100 %",
        "do: check the bypass valve",
        "±5.0 l/h  ██████┃██████████»  63.5 × threshold",
        "0.5 × threshold",
    ):
        assert part in text(leaking()), part
    why = text(leaking(), "explanation", (80, 60))
    assert "because of these differences between estimates of the same flow (l/h)" in why
    assert "kb/faults/leakage.yaml" in why
    assert "the end of the recording" not in why
    forgotten = replace(leaking(), diagnosis=None)
    assert "Its rows are no longer remembered" in text(forgotten, "explanation")
    assert "◆ M NEW A: the pump delivers" in text(forgotten)
    known = replace(leaking(), acknowledged=frozenset({leaking().active[0].id}))
    assert "NEW" not in text(known)
    assert "(acknowledged)" in text(known, size=(80, 60))


def test_not_judged_nothing_found_and_nothing_known_are_told_apart() -> None:
    """Where nothing is wrong, each residual stands beside its threshold."""
    part = " ".join(text(failing(), size=(120, 40)).split())
    assert "Cannot be judged now ▼ C NEW cannot detect errors of B.dp" in part
    assert "Past events 2026-09-21 16:14:11 ◆ M began A.leakage 0.600" in part
    sound, blind = text(healthy()), text(before())
    assert "✓ OK, no fault found" in sound
    assert "Residuals of the last settled stretch, until 2026-09-21 16:14:19" in sound
    for residual in compiled("abc").residuals:
        assert re.search(rf"{residual.id} +-?[\d.]+ l/h +±[\d.]+ l/h .* 0\.\d × threshold", sound)
    assert "Nothing could be judged yet" in blind
    assert "✗ NOT CONNECTED" in blind
    assert "connection refused" in blind
    assert "no fault found" not in text(replace(before(), status="ok"))


def test_symbol_and_letter_say_what_colour_says() -> None:
    """Every status has a shape and a letter of its own, and so has a bar beyond its threshold."""
    assert len({symbol for symbol, _ in STATUS.values()}) == len(STATUS)
    for letter in "FCSM":
        episode = replace(leaking().active[0], status=letter)
        lines = drawn(replace(leaking(), status=letter, active=(episode,)))
        symbol = STATUS[letter][0]
        assert lines[0].startswith(f"{symbol} {letter} ")
        assert any(line.startswith(f"> {symbol} {letter} NEW") for line in lines)


@pytest.mark.parametrize("size", [(80, 24), (120, 40), (40, 10), (20, 4)])
def test_picture_fills_its_size(size: tuple[int, int]) -> None:
    for view in VIEWS:
        for now in (leaking(), failing(), healthy(), before()):
            lines = drawn(now, ViewState(view=view), size)
            assert len(lines) == size[1]
            assert {cell_len(line) for line in lines} <= {size[0]}


def test_every_line_and_view_can_be_reached() -> None:
    """The selection stays, also where what stood before it has ended."""
    now, console = failing(), Terminal(file=io.StringIO(), width=80, height=24)
    state, seen, marked = ViewState(), set(), []
    for _ in range(32):
        lines = drawn(now, state)
        seen.update(lines)
        marked.append(sum(line.startswith("> ") for line in lines))
        state = after(state, "down", now, Screen(now, state, 80, 24).room(console))
    assert {*marked[: len(now.active)]} == {1}
    assert state.selected == listed(now)[-1].id
    assert any("began  B.dp is stuck" in line for line in seen)
    for _ in range(32):
        state = after(state, "up", now, Screen(now, state, 80, 24).room(console))
    assert state == ViewState(selected=listed(now)[0].id)
    now = leaking()
    opened = after(ViewState(), "enter", now, 0)
    assert "explanation" == opened.view
    assert after(opened, "enter", now, 0).view == after(opened, "back", now, 0).view == "plant"
    assert after(ViewState(), "enter", healthy(), 0).view == "plant"
    now = failing()
    state = after(ViewState(), "down", now, 0)
    later = replace(now, active=now.active[1:])  # what stood before it has ended
    assert drawn(later, state)[4].startswith("> ◆ M")


@pytest.mark.parametrize("text", TEXTS, ids=repr)
def test_no_text_steers_the_terminal(text: str) -> None:
    """An event stays on its lines."""
    now, out = hostile(text), io.StringIO()
    with LiveScreen(nobody, Terminal(file=out, width=80)) as live:
        live.show(now)
    below = sum(
        (event.what == "ended")
        + (event.what == "began") * (bool(event.episode.action) + (event.episode.kind == "fault"))
        for event in now.past
    )
    assert len(now.past) + below == out.getvalue().count("\n")
    assert "\x1b" not in out.getvalue()
    now, out = hostile(text[:400]), io.StringIO()
    console = Terminal(file=out, width=80, height=24, force_terminal=True, color_system="truecolor")
    for view in VIEWS:
        for one in listed(now)[:3]:
            state = ViewState(selected=one.id, view=view)
            console.print(Screen(now, state, 80, 24), end="")
    plain = re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue())
    odd = {c for c in plain if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Co", "Cn")}
    assert odd <= {"\n"}
    assert {cell_len(line) for line in plain.split("\n")} <= {80, 160, 0}


ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def terminal(out: io.StringIO) -> Terminal:
    return Terminal(file=out, width=80, height=24, force_terminal=True)


@pytest.fixture
def ends() -> Iterator[tuple[int, int]]:
    """Both ends of a terminal."""
    both = pty.openpty()
    yield both
    for end in both:
        with suppress(OSError):
            os.close(end)


def test_operator_acknowledges_and_quits(ends: tuple[int, int]) -> None:
    out, asked, now = io.StringIO(), list[tuple[str, str]](), failing()
    with LiveScreen(lambda *a: asked.append(a), terminal(out), Keys(ends[1])) as live:
        live.show(now)
        os.write(ends[0], b"\x1b[Ba\r")
        until(lambda: "because of these differences" in out.getvalue())
        assert not live.quit
        os.write(ends[0], b"q")
        until(lambda: live.quit)
    assert [(now.active[1].id, live_screen.who())] == asked
    assert live_screen.who().endswith("terminal")
    before, _, behind = out.getvalue().rpartition("\x1b[?1049l")
    assert "\x1b[?1049h" in before
    assert "✖ F failure: B.dp is stuck at 1.82294 bar" in ESCAPES.sub("", behind)


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
    words = (
        "    A: the pump delivers {} % less than its characteristic predicts; it leaks internally"
    )
    words += " or through its bypass"
    line = "    since {}; do: check the bypass valve, then the clearance of the pump"
    assert out.getvalue().splitlines() == [
        "2026-09-21 16:13:31  ◆ M  began A.leakage 0.200",
        words.format("20"),
        line.format("2026-09-21 16:13:31"),
        "2026-09-21 16:13:39  ✓  ended A.leakage 0.200",
        "    from 2026-09-21 16:13:31 to 16:13:39",
        "2026-09-21 16:13:51  ◆ M  began A.leakage 0.399",
        words.format("39.9"),
        line.format("2026-09-21 16:13:51"),
        "2026-09-21 16:13:59  ✓  ended A.leakage 0.399",
        "    from 2026-09-21 16:13:51 to 16:13:59",
        "2026-09-21 16:14:11  ◆ M  began A.leakage 0.600",
        words.format("60"),
        line.format("2026-09-21 16:14:11"),
    ]
    monkeypatch.setenv("TERM", "dumb")
    out = io.StringIO()
    with LiveScreen(nobody, terminal(out), reported=2) as live:
        live.show(replace(now, past=now.past[:2]))
    assert "1 event in between stands in the journal" in out.getvalue()
    assert 6 == len(out.getvalue().splitlines())
    assert "\x1b" not in out.getvalue()


def test_age_is_that_of_the_last_row(monkeypatch: pytest.MonkeyPatch) -> None:
    present = Present(compiled("abc"), "x", nothing_yet(False))
    assert present.now().age is None
    clock = [10.0]
    monkeypatch.setattr(moment, "monotonic", lambda: clock[0])
    for rows, clock[0] in ((3, 10.0), (3, 12.0), (4, 13.0), (4, 14.0)):
        present.update(replace(nothing_yet(False), count=rows), (), None)
    clock[0] = 15.0
    assert 2.0 == present.now().age


def _none() -> Keys:
    """No keys: a descriptor that is no terminal."""
    return Keys(os.open(os.devnull, os.O_RDONLY))


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        (b"\x1b[A\x1b[B\x1bOA\x1bOB", ["up", "down"] * 2),
        (b"\raq", ["enter", "acknowledge", "quit"]),
        (b"\x1b[15~\x1b[1;5C\x1b[3~z\xff\xc3\xa9", []),
        (b"\x1b[<0;1;1Mq", ["quit"]),
    ],
)
def test_keys_have_names(ends: tuple[int, int], sent: bytes, keys: list[str]) -> None:
    with Keys(ends[1]) as pressed:
        os.write(ends[0], sent)
        assert keys == pressed.take(0.05)


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
