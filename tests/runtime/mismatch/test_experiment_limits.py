"""Experiments within limits: nothing that may be proposed ever leaves them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset

from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.experiment.forecast import Forecast, Places
from rulec.mismatch.experiment.plan import best_within
from rulec.mismatch.experiment.points import (
    Feasible,
    InputRanges,
    feasible,
    input_ranges,
    places_in,
)
from rulec.separation.allowed import Allowed, Range, allowed_of
from tests.runtime.mismatch.made import opened, recorded, rows_at, tour

LIMITS = 80
"""Sets of limits; of each, all places that may be proposed are looked at."""

HALVES = np.array([0.5, 0.5])

ROUNDING = 1e-9
"""Share of a value that is lost between units."""


def _limits(random: np.random.Generator, system: System) -> Allowed:
    """Limits of some inputs and of one reading, some of them far outside of what was recorded."""
    inputs = {}
    for signal in system.ruleset.signals:
        if signal.is_input and random.random() < 0.8:
            reference = signal.shown(signal.reference)
            lowest, highest = np.sort(reference * random.uniform(0.3, 1.7, 2))
            inputs[signal.id] = Range(
                signal=signal,
                lowest=float(lowest),
                highest=float(highest),
                rate=float(random.choice([math.inf, random.uniform(0.1, 100.0)])),
                hold=float(random.choice([0.0, random.uniform(1.0, 1000.0)])),
                costs=bool(random.random() < 0.3),
            )
    name = str(random.choice([s.id for s in system.ruleset.signals if not s.is_input]))
    ends = np.sort(system.ruleset.signal_by_id[name].reference * random.uniform(0.2, 2.0, 2))
    return Allowed(inputs, frozenset(), {name: (float(ends[0]), float(ends[1]))})


def _any_foretold(random: np.random.Generator, ruleset: Ruleset, places: Places) -> list[Forecast]:
    """Any readings at all by two explanations; of some places nothing is predicted."""
    n = len(places)
    point = np.flatnonzero(random.random(n) < 0.9)
    names = [s.id for s in ruleset.signals if not s.is_input]
    told = []
    for true in range(2):
        off = [random.normal(0.0, 2.0, len(point)) for _ in range(2)]
        off[true] = np.zeros(len(point))
        readings = {
            name: ruleset.signal_by_id[name].reference * random.uniform(0.5, 1.5, n)
            for name in names
        }
        spread = {name: np.abs(values) * 0.02 for name, values in readings.items()}
        covariance = (np.eye(len(point)), np.eye(len(point)))
        own = Forecast(readings, point, (off[0], off[1]), covariance, spread, spread, (0.0, 0.0))
        told.append(own)
    return told


def _check(ruleset: Ruleset, given: Allowed, told: list[Forecast], found: Feasible) -> None:
    """All places that may be proposed, each limit looked up anew."""
    may = found.may_run
    for name, values in found.places.inputs.items():
        signal = ruleset.signal_by_id[name]
        shown, slack = signal.shown(values), ROUNDING * np.abs(signal.shown(values))
        if name not in found.reach.ranges:
            assert (values[may] == found.reach.present[name]).all(), f"{name} is not to be moved"
            continue
        own, (low, high) = given.inputs[name], signal.ends
        kept = (own.lowest - slack <= shown) & (shown <= own.highest + slack)
        kept &= (low - slack <= values) & (values <= high + slack)
        assert kept[may].all(), name
        moved = np.flatnonzero(may & (np.abs(values - values[-1]) > slack))
        assert not own.costs or all(name in found.costs[place] for place in moved), name
    for name, (low, high) in given.readings.items():
        for one in told:
            value, far = one.readings[name], limits.COVERED * one.spread[name]
            assert ((low <= value - far) & (value + far <= high))[may].all(), name


def test_thousands_of_places_keep_the_limits() -> None:
    """All that may be proposed, of any readings at all that are predicted, in any order."""
    random = np.random.default_rng(27)
    plant = opened("abc")
    ruleset = plant[0]
    recording = recorded(plant, tour(ruleset, 240))
    system = rows_at(plant, recording).system
    looked = steps = 0
    for number in range(LIMITS):
        given = _limits(random, system)
        reach = input_ranges(system, recording, 1.0, allowed_of(ruleset, given))
        if not reach.ranges:
            continue
        places = places_in(system, reach)
        told = _any_foretold(random, ruleset, places)
        found = feasible(ruleset, places, reach, told)
        may = np.flatnonzero(found.may_run)
        looked += len(may)
        _check(ruleset, given, told, found)
        order = random.permutation(may)[:5].tolist()
        before = len(places) - 1
        for place, (ramp, hold) in zip(order, found.times(order), strict=True):
            for name in reach.ranges:
                own, signal = given.inputs[name], ruleset.signal_by_id[name]
                way = signal.shown(places.inputs[name][place])
                way -= signal.shown(places.inputs[name][before])
                assert abs(way) / own.rate <= ramp * (1.0 + ROUNDING) + ROUNDING
                assert hold >= own.hold
            before = place
        if number % 16 == 0:
            seconds = 1.5 * found.seconds(order[:1])
            best = best_within(told, HALVES, 2, seconds, found, 0.0)
            assert set(best.choice.places) <= set(may.tolist())
            assert found.seconds(best.choice.places) <= seconds
            steps += len(best.choice.places)
    assert looked > 1000
    assert steps


def _two_places(lost: tuple[str, ...], forbids: bool) -> Feasible:
    """Two places that can be run, of which the second may lose product or be forbidden, and the
    present one."""
    places = Places({"A.n": np.array([1.0, 2.0, 0.0])}, np.zeros(3, dtype=np.intp), np.zeros(3))
    possible, forbidden = np.array([True, True, False]), np.array([False, forbids, False])
    reach = InputRanges({"A.n": (1.0, 2.0)}, 60.0)
    return Feasible(places, reach, possible, {"A.dp": forbidden}, ((), lost, ()), ())


def _apart_by(first: float, second: float) -> list[Forecast]:
    """Two explanations that predict one reading at each of two places, so far apart."""
    point, off, known = np.array([0, 1]), np.array([first, second]), (np.eye(2), np.eye(2))
    none = np.zeros(2)
    offs = ((none, off), (-off, none))
    return [Forecast({}, point, own, known, shares=(0.0, 0.0)) for own in offs]


def test_the_best_step_within_limits() -> None:
    """Where the place that tells more is forbidden the other one is taken, and the recipe has why;
    product is lost only where that tells clearly more."""
    for off, lost, forbids, taken in (
        ((1.0, 3.0), (), True, (0,)),
        ((1.0, 3.0), (), False, (1,)),
        ((4.0, 4.01), ("A.n",), False, (0,)),
        ((1.0, 4.0), ("A.n",), False, (1,)),
    ):
        found = _two_places(lost, forbids)
        best = best_within(_apart_by(*off), HALVES, 1, 3600.0, found, 0.0)
        assert best.choice.places == taken
        assert best.hindering == (("A.dp",) if forbids else ())
        assert not best.time_is_short


@pytest.mark.parametrize(("seconds", "steps"), [(90.0, 1), (120.0, 2)])
def test_no_time_for_more_is_told(seconds: float, steps: int) -> None:
    """Two steps of a minute do not fit into one and a half."""
    best = best_within(_apart_by(2.0, 2.0), HALVES, 2, seconds, _two_places((), False), 0.0)
    assert (len(best.choice.places), best.time_is_short) == (steps, steps < 2)


def test_set_points_lie_where_pumps_run() -> None:
    """A pump that stood now and then was not run between that and its lowest speed."""
    plant = opened("abc")
    recording = recorded(plant, tour(plant[0], 240))
    system = rows_at(plant, recording).system
    data, least = system.data, system.ruleset.signal_by_id["A.n"].minimum
    stands = np.where(np.arange(len(data)) % 9 == 0, 0.0, data.values["A.n"])
    points = replace(data.points, values={**data.values, "A.n": stands})
    stood = replace(system, data=replace(data, points=points))
    assert least is not None
    assert least <= input_ranges(stood, recording, 1.0).ranges["A.n"][0] <= data.values["A.n"].max()
