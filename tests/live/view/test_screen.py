"""The picture on the terminal: what stands on it, how large it is, and that nothing steers it."""

from __future__ import annotations

import io
import re
import unicodedata
from dataclasses import replace

import pytest
from rich.cells import cell_len
from rulec_runtime.live.now import Now
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


def test_finding_comes_first_with_all_that_an_operator_needs() -> None:
    text = "\n".join(drawn(leaking()))
    for part in (
        "◆ M maintenance required",
        "● connected: opc.tcp://plant.example:48",
        "last row 2026-09-21 16:14:19 (3 s ago)",
        "A ◆ M  B ✓ ok  C ✓ ok",
        "> ◆ M NEW A: the pump delivers 60 % less than its law says",
        "A.leakage 0.600 (95\u00a0%: 0.596 to 0.604), since 16:14:11 (8 s)",
        "probability 100\u00a0%",
        "do: check the bypass valve",
        "±5.0 l/h  ██████┃██████████»  63.5 × BEYOND",
        "0.5 × within",
    ):
        assert part in text, part


def test_what_cannot_be_judged_is_told_with_its_reason() -> None:
    text = " ".join(" ".join(drawn(failing(), size=(120, 40))).split())
    assert "Cannot be judged now ▼ C NEW cannot see errors of B.dp" in text
    assert "probability 100 %" in text
    assert "Past events 2026-09-21 16:14:11 ◆ M began A.leakage 0.600" in text


def test_nothing_found_and_nothing_known_are_told_apart() -> None:
    sound, blind = "\n".join(drawn(healthy())), "\n".join(drawn(before()))
    assert "✓ ok nothing found" in sound
    assert "Nothing could be judged yet" in blind
    assert "✗ NOT CONNECTED" in blind
    assert "connection refused" in blind
    assert "nothing found" not in "\n".join(drawn(replace(before(), status="ok")))


def test_each_residual_stands_beside_its_threshold_where_nothing_is_wrong() -> None:
    text = "\n".join(drawn(healthy()))
    assert "Residuals of the last settled stretch, until 2026-09-21 16:14:19" in text
    for residual in compiled("abc").residuals:
        assert re.search(rf"{residual.id} +-?[\d.]+ l/h +±[\d.]+ l/h .* 0\.\d × within", text)


def test_acknowledged_is_no_longer_new() -> None:
    now = leaking()
    known = replace(now, acknowledged=frozenset({now.active[0].id}))
    assert "NEW" not in "\n".join(drawn(known))
    assert "(acknowledged)" in "\n".join(drawn(known, ViewState(view="past")))


def test_explanation_is_that_of_the_report() -> None:
    text = "\n".join(drawn(leaking(), ViewState(view="explanation"), (80, 60)))
    assert "because these estimates of the same flow disagree (l/h)" in text
    assert "kb/faults/leakage.yaml" in text
    assert "the end of the recording" not in text


def test_what_the_diagnosis_has_forgotten_is_still_told() -> None:
    now = replace(leaking(), diagnosis=None)
    assert "Its rows are no longer remembered" in "\n".join(
        drawn(now, ViewState(view="explanation"))
    )
    assert "◆ M NEW A: the pump delivers" in "\n".join(drawn(now))


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
@pytest.mark.parametrize("view", VIEWS)
def test_picture_fills_its_size(size: tuple[int, int], view: View) -> None:
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


def test_views_open_and_close() -> None:
    now = leaking()
    for key, view in (("enter", "explanation"), ("past", "past"), ("help", "help")):
        opened = after(ViewState(), key, now, 0)
        assert view == opened.view
        assert after(opened, key, now, 0).view == after(opened, "back", now, 0).view == "plant"
    assert after(ViewState(), "enter", healthy(), 0).view == "plant"


def test_selection_survives_what_ends_before_it() -> None:
    now = failing()
    look = after(ViewState(), "down", now, 0)
    later = replace(now, active=now.active[1:])
    assert drawn(later, look)[4].startswith("> ◆ M")


@pytest.mark.parametrize("text", TEXTS, ids=repr)
def test_no_text_steers_the_terminal(text: str) -> None:
    now = hostile(text[:400])
    for view in VIEWS[:3]:
        out = io.StringIO()
        console = Terminal(
            file=out, width=80, height=24, force_terminal=True, color_system="truecolor"
        )
        for at in range(3):
            look = ViewState(selected=listed(now)[at].id, view=view)
            console.print(Screen(now, look, 80, 24), end="")
        plain = re.sub(r"\x1b\[[0-9;]*m", "", out.getvalue())
        odd = {c for c in plain if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Co", "Cn")}
        assert odd <= {"\n"}
        assert {cell_len(line) for line in plain.split("\n")} <= {80, 160, 0}
