"""Rivals: what is planted wins on blocks it was not fitted to; rivals lose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.steady.locate import spot_column
from rulec.mismatch.search.compete import Shuffled, placebo_gains, shuffled_gains
from rulec.mismatch.search.rivals import at_an_end
from tests.runtime.mismatch.made import alone
from tests.runtime.mismatch.warm import SLIP, after, before, plain, trial

UNPLANTED = ("A.copper-loss@P_law", "A.line-laminar@plant", "A.slip-linear@Q_geo")


def column(warm: bool = True) -> Array:
    """Slopes of the residuals by an error of the slip."""
    spot = next(s for s in alone()[1].spots if s.id == "definition:A.Q_geo")
    found = spot_column(plain(warm), spot)
    assert found is not None
    return found


def test_the_planted_effect_gains_where_it_was_not_fitted() -> None:
    """Surely, and by about what it gained where it was fitted."""
    gain = after().gain_over(before())
    assert gain > 30.0
    assert after().sureness_over(before()) > 3.0
    assert after().certainty_over(before()) > 2.0
    fitted = before().fitted.objective - after().fitted.objective
    assert fitted == pytest.approx(gain, rel=0.5)


def test_gains_are_antisymmetric() -> None:
    """What one gains over the other, the other loses."""
    assert after().gain_over(before()) == -before().gain_over(after())
    assert 0.0 == after().gain_over(after())
    assert 0.0 == after().certainty_over(after())
    assert 0.0 == after().sureness_over(after())


def test_held_out_blocks_play_no_part() -> None:
    """Their log likelihood is none at all."""
    data = plain().rows.system.data
    shut = np.setdiff1d(np.unique(data.block), np.unique(data.block[data.open]))
    assert len(shut) >= 4
    assert not np.any(after().blocks[shut])


@pytest.mark.parametrize("name", [SLIP, *UNPLANTED])
def test_nothing_wins_on_a_healthy_recording(name: str) -> None:
    """On blocks it was not fitted to, no candidate gains more than a few units."""
    try:
        contestant = after(name, warm=False)
    except ValueError:
        return  # it does not even gain where it was fitted
    assert contestant.gain_over(before(warm=False)) < 6.0


def test_its_own_course_beats_a_shuffled_one() -> None:
    """Of twenty shuffles by blocks none comes near."""
    found = shuffled_gains(plain(), after().fitted, 20, 1)
    assert (20,) == found.gains.shape
    assert found.own > 2.0 * float(found.gains.max())
    assert found.own > 20.0
    assert not found.is_imitated


@pytest.mark.parametrize(
    ("own", "mean", "best", "imitated"),
    [
        (50.0, 0.0, 20.0, False),
        (50.0, 0.0, 60.0, True),
        (50.0, 49.0, 51.0, False),
        (50.0, 90.0, 60.0, True),
    ],
)
def test_a_term_that_hardly_changes_has_no_course_to_shuffle(
    own: float, mean: float, best: float, imitated: bool
) -> None:
    """Its mean explains as much; where the mean explains more, its course does harm."""
    assert Shuffled(own, mean, np.array([1.0, best])).is_imitated == imitated


def test_what_all_readings_say_is_told_by_the_fit_to_all() -> None:
    """Nothing over itself; held-out blocks play no part."""
    data = plain().rows.system.data
    shut = np.setdiff1d(np.unique(data.block), np.unique(data.block[data.open]))
    assert not np.any(after().within[shut])
    assert after().likelier_than(after()) == 0.0
    assert after().likelier_than(before()) > 20.0


def test_shuffles_are_drawn_from_the_seed() -> None:
    """The same seed, the same rivals."""
    first, again, other = (shuffled_gains(plain(), after().fitted, 5, s).gains for s in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_functions_without_physics_lose() -> None:
    """As many waves in time at the same place gain less than the effect."""
    gains = placebo_gains(plain(), trial(), [column()], 1)
    assert after().gain_over(before()) > float(gains.max())
    assert np.all(gains >= 0)


def test_functions_without_physics_gain_nothing_from_noise() -> None:
    """On a healthy recording the best of ten waves is chance."""
    assert float(placebo_gains(plain(warm=False), trial(), [column(False)], 1).max()) < 8.0


def test_a_value_at_an_end_of_its_range_is_seen() -> None:
    """Of any of the laws that are asked for; one in between is at no end."""
    found = after()
    law = next(c for c in found.fitted.setting.joined if c.id == SLIP)
    free = next(u for u in law.unknowns if u.highest != u.null and np.isfinite(u.highest))
    values = {**found.fitted.setting.values, free.id: free.highest}
    moved = replace(found.fitted, setting=replace(found.fitted.setting, values=values))
    assert not at_an_end(found, law)
    assert not at_an_end(replace(found, fitted=moved))
    assert at_an_end(replace(found, fitted=moved), law)
