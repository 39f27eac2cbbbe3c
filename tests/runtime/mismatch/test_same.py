"""Laws that say the same have even odds, and a finding beats every rival that it prints."""

from __future__ import annotations

import functools
from dataclasses import replace

import pytest

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.screen import screen
from rulec.mismatch.result import Rival
from rulec.mismatch.search.compete import CrossValidated, contest, entered
from rulec.mismatch.search.weigh import net_gain, odds_of, says_the_same
from rulec.mismatch.search.winner import recorded as records_of
from tests.runtime.mismatch.made import alone, recorded, rows_at, tour

OFFSET, STANDBY = "A.offset-power@P_el", "A.standby-power@P_law"


@functools.cache
def before() -> CrossValidated:
    """The plain model of a pump that takes 30 W more, or seems to."""
    recording = recorded(alone(), tour(alone()[0], 240), {OFFSET: {"z": 30.0}})
    rows = rows_at(alone(), recording)
    return contest(fit(rows, Configuration(), rows.system.data.open), None)


@functools.cache
def after(name: str) -> CrossValidated:
    (trial,) = screen(before().fitted, [c for c in alone()[1].candidates if c.id == name])
    return entered(before().fitted, trial)


def test_a_constant_loss_and_an_offset_have_even_odds() -> None:
    """Nothing recorded tells them apart, and so no habit does: they stood at 92 and 8 %."""
    assert says_the_same(after(OFFSET), after(STANDBY))
    assert 1.0 == odds_of(after(OFFSET), after(STANDBY)) == odds_of(after(STANDBY), after(OFFSET))


def test_models_that_leave_something_else_do_not_say_the_same() -> None:
    """The plain model is none of the class."""
    assert not says_the_same(before(), after(OFFSET))


def test_rivals_of_two_are_told_in_part() -> None:
    """A pair shares its gain, and what lost against both is told likewise."""
    winner = after(OFFSET)
    assert winner.trial is not None
    second = after(STANDBY).trial
    assert second is not None
    pair = replace(winner, trial=replace(winner.trial, along=(second,)))
    gain = net_gain(pair, before())
    found = records_of(pair, before(), [], (Rival("another", 0.8 * gain),))
    assert [0.5 * gain] * 2 == pytest.approx([r.gain for r in found])
    assert all(rival.gain < r.gain for r in found for rival in r.rivals)
