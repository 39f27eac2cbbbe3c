"""What a column could be is tried only where the estimates that do not read it agree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors import headers, limits
from rulec_runtime.diagnosis.sensors.bench import Bench, bench_of
from rulec_runtime.diagnosis.sensors.changed import Changed
from rulec_runtime.diagnosis.sensors.headers import Misread, misread_columns
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.sensors.near import Near, Verdicts
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.recordings.recording import Recording

from tests.rig.follower.plants import Planted, recorded, side_by_side
from tests.runtime import test_sensor_health as health

ROWS = 200


def bench(plant: str, bend: str) -> tuple[Ruleset, Bench]:
    ruleset = health.plant(plant)
    bent, _, _ = health.CASES[bend]
    recording = examine(bent(health.recorded(plant), ruleset), ruleset, headers=False).recording
    found = bench_of(recording, ruleset)
    assert found is not None
    return ruleset, found


@pytest.mark.parametrize("plant", ["abc", "mixing-rig"])
def test_chi_square_without_estimates_is_that_of_the_others(plant: str) -> None:
    ruleset, of_all = bench(plant, "swapped pressures")
    tried = 0
    for signal in sorted(ruleset.observed & set(of_all.points.values)):
        readers = of_all.readers(signal)
        values = {**of_all.points.values, signal: np.full(len(of_all.points), np.nan)}
        others = of_all.agreement(replace(of_all.points, values=values))
        if not (others.freedom > 0).all() or not readers.any():
            continue
        least = of_all.left_out.least(readers)
        np.testing.assert_allclose(least, others.excess * others.limit, rtol=1e-6, atol=1e-9)
        tried += 1
    assert tried > 3


def test_several_ways_to_read_at_a_time_are_judged_as_each_is() -> None:
    _, of_all = bench("abc", "swapped pressures")
    points = of_all.points
    ways = [1.0, 1.01, 0.9] * 20

    def read(factor: float) -> Points:
        return replace(points, values={**points.values, "A.dp": factor * points.values["A.dp"]})

    for factor, found in of_all.agreements(ways, read):
        alone = of_all.agreement(read(factor))
        np.testing.assert_allclose(found.excess, alone.excess, rtol=1e-9)
        np.testing.assert_array_equal(found.freedom, alone.freedom)
        np.testing.assert_allclose(found.observed.flows, alone.observed.flows, rtol=1e-12)


@pytest.fixture(scope="module")
def leaking() -> tuple[Ruleset, Recording]:
    """A plant with two hundred readings, in one of whose 29 lines a pump leaks from the start."""
    ruleset = side_by_side()
    leak = [Planted("L3A.leakage", 0.3, 0, ROWS)]
    return ruleset, recorded(ruleset, ROWS, leak, 0.1, np.random.default_rng(3))


def test_a_fault_in_a_large_plant_has_few_columns_tried(
    leaking: tuple[Ruleset, Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    ruleset, recording = leaking
    of_all = bench_of(recording, ruleset)
    assert of_all is not None
    known: list[int] = []
    judge = Near.judge

    def counted(near: Near, signal: str, values: Array, *rest: Any) -> Verdicts:
        known.append(len(values))
        return judge(near, signal, values, *rest)

    monkeypatch.setattr(Near, "judge", counted)
    tried = [*headers._candidates(recording, of_all, headers._with_all(recording, of_all), set())]
    assert sum(known) > 1000
    assert len(tried) < sum(known) / 20
    assert misread_columns(recording, of_all, set()) is None


@pytest.mark.parametrize("bend", ["swapped pressures", "dead power"])
@pytest.mark.parametrize("plant", ["abc", "mixing-rig"])
def test_what_other_readings_leave(plant: str, bend: str) -> None:
    """By what changes alone as with all estimates anew."""
    ruleset, of_all = bench(plant, bend)
    recording = health.CASES[bend][0](health.recorded(plant), ruleset)
    plain, changed, known = headers._with_all(recording, of_all), Changed(of_all), of_all.recorded
    compared = 0
    for one in headers._candidates(recording, of_all, plain, set()):
        points = headers._read(of_all, one)
        every, found = of_all.agreement(points), changed.outcome(points, one.signals)
        readers = headers._readers(of_all, one)
        more = (every.valid & ~known.valid).any(axis=0)
        np.testing.assert_array_equal(found.more, more)
        np.testing.assert_array_equal(found.used, every.valid[readers].any(axis=0))
        np.testing.assert_array_equal(found.fewer[~more], (every.freedom < known.freedom)[~more])
        same = ~more & np.isfinite(every.excess)
        left = every.excess[same] * every.limit[same]
        np.testing.assert_allclose(found.chi[same], left, rtol=limits.CHANGED_ROUGHLY, atol=1e-6)
        compared += int(same.sum())
    assert compared > 10


@pytest.mark.parametrize("bend", ["swapped pressures", "dead power"])
@pytest.mark.parametrize("plant", ["abc", "mixing-rig"])
def test_what_is_not_tried_would_be_refused(
    plant: str, bend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    ruleset, of_all = bench(plant, bend)
    recording = health.CASES[bend][0](health.recorded(plant), ruleset)

    def candidates() -> list[Misread]:
        plain = headers._with_all(recording, of_all)
        return [*headers._candidates(recording, of_all, plain, set())]

    changed = Changed(of_all)
    tried = {one.texts for one in candidates() if headers._may_agree(of_all, one, changed)}

    def allowing(near: Near, signal: str, values: Array, *rest: Any) -> Verdicts:
        none = np.zeros(values.shape, dtype=bool)
        return Verdicts(~none, none, ~none)

    monkeypatch.setattr(Near, "judge", allowing)
    left = [one for one in candidates() if one.texts not in tried]
    assert len(left) > 10
    for one, found in of_all.agreements(left, lambda m: headers._read(of_all, m)):
        sense = headers._makes_sense(of_all, one, found)
        assert not (sense and headers._beats_faults(of_all, one, found)), one.texts
