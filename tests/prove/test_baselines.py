"""Baselines learn what can be learnt, and from nothing that is held out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rulec.prove.aligned import (
    Array,
    Course,
    at_times,
    columns_of,
    courses_of,
    drivers_of,
    lagged,
)
from rulec.prove.baselines import (
    Baselines,
    dynamic_baselines,
    mended_by_trees,
    one_thread,
    stationary_baselines,
)
from rulec.prove.sparse import mended_by_law, mended_by_map

N = 600
HELDOUT = (np.arange(N) * 25 // N) % 5 == 2


def settled(effect: float, seed: int = 0) -> tuple[dict[str, Array], Course]:
    """A flow whose error follows the temperature, with noise of size 1."""
    random = np.random.default_rng(seed)
    time = np.arange(N, dtype=float)
    columns = {
        "time [s]": time,
        "A.n [rpm]": 900 + 50 * np.sign(np.sin(time / 7)) + random.normal(0, 1, N),
        "A.T [degC]": 35 + 15 * np.sin(time / 60) + random.normal(0, 0.1, N),
        "A.dp [bar]": random.normal(2, 0.3, N),
    }
    columns["A.Q [l/h]"] = (
        500.0 - effect * (columns["A.T [degC]"] - 35) ** 2 / 20 + random.normal(0, 1, N)
    )
    return columns, Course("A.Q", time, HELDOUT, columns["A.Q [l/h]"], np.full(N, 500.0 - effect))


def stored(effect: float, seed: int = 0) -> tuple[dict[str, Array], Course]:
    """A level whose error follows the square of the input by a first-order lag."""
    random = np.random.default_rng(seed)
    time = 4.0 * np.arange(N)
    u = np.interp(np.arange(N), np.arange(0, N, 20), random.uniform(-1.7, 1.7, N // 20))
    lag = np.zeros(N)
    for k in range(N - 1):
        lag[k + 1] = 0.95 * lag[k] + 0.05 * effect * u[k] ** 2
    predicted = np.convolve(u, np.ones(10) / 10)[:N]
    measured = predicted + lag + random.normal(0, 0.05, N)
    columns = {"time [s]": time, "u [V]": u, "y [V]": measured}
    return columns, Course("lower.y", time, HELDOUT, measured, predicted)


def test_trees_mend_a_smooth_residual_of_a_recorded_driver() -> None:
    """So does a polynomial, here the truth; the noise is 1."""
    found = stationary_baselines(*settled(8.0))
    assert found.recalibrated > 3.0
    assert found.trees < 1.3
    assert found.sindy < 1.1
    assert (120, False) == (found.points, found.ran_away)


@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_is_learnt_from_noise(seed: int) -> None:
    """Errors stay within 10 % of those of recalibration."""
    columns, course = stored(0.0, seed)
    for found in (
        stationary_baselines(*settled(0.0, seed)),
        dynamic_baselines(columns, course, ["u [V]"]),
    ):
        assert pytest.approx(1.0, abs=0.1) == found.ratios["boosted trees"]
        assert pytest.approx(1.0, abs=0.1) == found.ratios["PySINDy"]


def test_residuals_of_plants_that_store_are_learnt_from_inputs() -> None:
    """The map of the truth lies in the library; trees see lags."""
    columns, course = stored(3.0)
    found = dynamic_baselines(columns, course, ["u [V]"])
    assert found.ratios["PySINDy"] < 0.6
    assert found.ratios["boosted trees"] < 0.6
    assert not found.ran_away


def test_held_out_samples_are_never_seen() -> None:
    """Other readings there change no prediction, neither of trees nor of laws and maps."""
    for columns, course in (settled(8.0), stored(3.0)):
        odd = np.where(HELDOUT, course.measured + 100.0 * np.arange(N), course.measured)
        own = next(h for h, v in columns.items() if v is course.measured)
        other, changed = {**columns, own: odd}, replace(course, measured=odd)
        drivers, again = drivers_of(columns, course, [own]), drivers_of(other, changed, [own])
        assert list(drivers) == list(again)
        # Time alone suffices: trees that saw a block would follow it.
        few = [{"time [s]": d["time [s]"]} for d in (drivers, again)]
        with one_thread():
            trees = [mended_by_trees(few[0], course), mended_by_trees(few[1], changed)]
        np.testing.assert_array_equal(*trees)
        np.testing.assert_array_equal(
            mended_by_law(drivers, course).mended, mended_by_law(again, changed).mended
        )
        np.testing.assert_array_equal(
            mended_by_map(drivers, course).mended, mended_by_map(again, changed).mended
        )


def test_the_reading_itself_is_no_driver() -> None:
    """Not under its own name, nor under another one."""
    columns, course = settled(8.0)
    renamed = {**columns, "flow [l/h]": columns["A.Q [l/h]"]}
    assert ["time [s]", "A.n [rpm]", "A.T [degC]", "A.dp [bar]"] == list(
        drivers_of(renamed, course)
    )


def test_a_simulation_that_runs_away_counts_as_recalibration() -> None:
    """A residual that grows wherever it is seen, and falls back where it is not."""
    time = np.arange(N, dtype=float)
    residual = 1e-3 * np.exp(((np.arange(N) - 60) % 120) / 15.0)
    course = Course("x", time, HELDOUT, residual, np.zeros(N))
    found = mended_by_map({"u": np.sin(time)}, course)
    assert found.ran_away
    np.testing.assert_array_equal(course.recalibrated, found.mended)


def test_hostile_courses_get_an_answer() -> None:
    """Gaps, columns without a number, nothing to learn from, nothing to judge."""
    columns, course = settled(8.0)
    columns["A.T [degC]"][::7] = np.nan
    columns["A.x [1]"] = np.full(N, np.nan)
    gaps = replace(course, measured=np.where(np.arange(N) % 11, course.measured, np.nan))
    assert stationary_baselines(columns, gaps).trees < gaps.residual[gaps.judged].std()
    blind = replace(course, measured=np.full(N, np.nan))
    assert 0 == stationary_baselines(columns, blind).points
    assert {} == stationary_baselines(columns, blind).ratios
    none = stationary_baselines(columns, replace(course, heldout=np.zeros(N, dtype=bool)))
    assert (0, {}) == (none.points, none.ratios)
    assert 0 == dynamic_baselines(columns, blind, ["A.n [rpm]"]).points


def test_columns_are_averaged_at_other_times() -> None:
    """Samples belong to the nearest time; where there is none, neighbours say what it was."""
    columns = {"time [s]": np.arange(6.0), "x": np.array([0.0, 2.0, np.nan, 4.0, 6.0, 8.0])}
    np.testing.assert_allclose([1.0, 4.0, 7.0], at_times(columns, np.array([0.5, 2.5, 4.5]))["x"])
    gap = {"time [s]": np.array([0.0, 1.0, 9.0, 10.0]), "x": np.array([0.0, 1.0, 9.0, 10.0])}
    np.testing.assert_allclose(5.0, at_times(gap, np.array([0.0, 1.0, 5.0, 9.0, 10.0]))["x"][2])


def test_lags_stand_still_before_the_beginning() -> None:
    """No sample of the future."""
    assert [1.0, 1.0, 2.0] == lagged({"x": np.array([1.0, 2.0, 3.0])})["x 1 ago"].tolist()


def test_tables_of_the_command_are_read() -> None:
    """As `--series` writes them."""
    text = (
        "time [s],heldout [1],A.Q measured [l/h],A.Q shipped [l/h],A.Q recalibrated [l/h],"
        "A.Q repaired [l/h]\n0,0,5,1,4,5\n1,1,,2,4,5\n"
    )
    [course] = courses_of(text)
    assert ("A.Q", [False, True]) == (course.signal, course.heldout.tolist())
    assert [1.0] == course.residual[course.learnt].tolist()
    assert np.isnan(columns_of(text)["A.Q measured [l/h]"][1])


def test_ratios_are_over_recalibration() -> None:
    """As a judged case carries them."""
    assert {"boosted trees": 0.5, "PySINDy": 2.0} == Baselines(
        points=9, recalibrated=2.0, trees=1.0, sindy=4.0, ran_away=False
    ).ratios
