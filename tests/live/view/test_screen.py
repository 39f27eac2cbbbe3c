"""The picture on the terminal: what stands on it, how large it is, and that nothing steers it."""

from __future__ import annotations

import io
import re
import unicodedata
from dataclasses import replace

import pytest
from rich.cells import cell_len
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.screen import Screen, View, ViewState, after
from rulec_runtime.live.view.words import listed
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.report.wording import STATUS

from tests.conftest import compiled
from tests.live.view.hostile import TEXTS, hostile
from tests.live.view.nows import before, failing, healthy, leaking

VIEWS: tuple[View, ...] = ("plant", "explanation", "past", "help")


def drawn(now: Now, look: ViewState | None = None, size: tuple[int, int] = (80, 24)) -> list[str]:
    """Lines without colour."""
    out = io.StringIO()
    console = Terminal(file=out, width=size[0], height=size[1])
    console.print(Screen(now, look or ViewState(), *size, age=3.2), end="")
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
    assert "(acknowledged)" in text(known, "past")


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


def test_every_line_of_the_body_can_be_reached() -> None:
    now, console = failing(), Terminal(file=io.StringIO(), width=80, height=24)
    look, seen, marked = ViewState(), set(), []
    for _ in range(32):
        lines = drawn(now, look)
        seen.update(lines)
        marked.append(sum(line.startswith("> ") for line in lines))
        look = after(look, "down", now, Screen(now, look, 80, 24).room(console))
    assert {*marked[: len(now.active)]} == {1}
    assert look.selected == listed(now)[-1].id
    assert any("began  B.dp is stuck" in line for line in seen)
    for _ in range(32):
        look = after(look, "up", now, Screen(now, look, 80, 24).room(console))
    assert look == ViewState(selected=listed(now)[0].id)


def test_views_open_and_close_and_the_selection_stays() -> None:
    now = leaking()
    for key, view in (("enter", "explanation"), ("past", "past"), ("help", "help")):
        opened = after(ViewState(), key, now, 0)
        assert view == opened.view
        assert after(opened, key, now, 0).view == after(opened, "back", now, 0).view == "plant"
    assert after(ViewState(), "enter", healthy(), 0).view == "plant"
    now = failing()
    look = after(ViewState(), "down", now, 0)
    later = replace(now, active=now.active[1:])  # what stood before it has ended
    assert drawn(later, look)[4].startswith("> ◆ M")


@pytest.mark.parametrize("text", TEXTS, ids=repr)
def test_no_text_steers_the_terminal(text: str) -> None:
    now, out = hostile(text[:400]), io.StringIO()
    console = Terminal(file=out, width=80, height=24, force_terminal=True, color_system="truecolor")
    for view in VIEWS[:3]:
        for one in listed(now)[:3]:
            look = ViewState(selected=one.id, view=view)
            console.print(Screen(now, look, 80, 24), end="")
    plain = re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue())
    odd = {c for c in plain if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Co", "Cn")}
    assert odd <= {"\n"}
    assert {cell_len(line) for line in plain.split("\n")} <= {80, 160, 0}
