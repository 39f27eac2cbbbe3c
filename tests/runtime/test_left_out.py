"""What a column could be is tried only where the estimates that do not read it agree."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.sensors import headers
from rulec_runtime.diagnosis.sensors.bench import Bench, bench_of
from rulec_runtime.diagnosis.sensors.changed import Changed
from rulec_runtime.diagnosis.sensors.headers import Misread, misread_columns
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.sensors.near import Near, Verdicts
from rulec_runtime.recordings.recording import Recording

from tests.rig.follower.plants import Planted, recorded, side_by_side
from tests.runtime import test_sensor_health as health

ROWS = 200


def candidates(of_all: Bench, recording: Recording) -> list[Misread]:
    """Ways to read columns that are tried."""
    plain = headers._with_all(recording, of_all)
    return [*headers._candidates(recording, of_all, plain, set())]


def test_a_fault_in_a_large_plant_has_few_columns_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two hundred readings; in one of 29 lines a pump leaks from the start."""
    ruleset, known = side_by_side(), list[int]()
    leak = [Planted("L3A.leakage", 0.3, 0, ROWS)]
    recording = recorded(ruleset, ROWS, leak, 0.1, np.random.default_rng(3))
    of_all = bench_of(recording, ruleset)
    assert of_all is not None
    judge = Near.judge

    def counted(near: Near, signal: str, values: Array, *rest: Any) -> Verdicts:
        known.append(len(values))
        return judge(near, signal, values, *rest)

    monkeypatch.setattr(Near, "judge", counted)
    tried = candidates(of_all, recording)
    assert sum(known) > 1000
    assert len(tried) < sum(known) / 20
    assert misread_columns(recording, of_all, set()) is None


@pytest.mark.parametrize(
    ("plant", "bend"), [("mixing-rig", "swapped pressures"), ("abc", "dead power")]
)
def test_what_is_not_tried_would_be_refused(
    plant: str, bend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Several ways at a time are judged as each is."""
    ruleset = health.plant(plant)
    recording = health.CASES[bend][0](health.recorded(plant), ruleset)
    of_all = bench_of(examine(recording, ruleset, headers=False).recording, ruleset)
    assert of_all is not None
    changed = Changed(of_all)
    made = candidates(of_all, recording)
    tried = {one.texts for one in made if headers._may_agree(of_all, one, changed)}

    def allowing(near: Near, signal: str, values: Array, *rest: Any) -> Verdicts:
        none = np.zeros(values.shape, dtype=bool)
        return Verdicts(~none, none, ~none)

    monkeypatch.setattr(Near, "judge", allowing)
    left = [one for one in candidates(of_all, recording) if one.texts not in tried]
    assert len(left) > 10
    for k, (one, found) in enumerate(of_all.agreements(left, lambda m: headers._read(of_all, m))):
        if k < 10:
            alone = of_all.agreement(headers._read(of_all, one))
            np.testing.assert_allclose(found.excess, alone.excess, rtol=1e-9)
            np.testing.assert_array_equal(found.freedom, alone.freedom)
        sense = headers._makes_sense(of_all, one, found)
        assert not (sense and headers._beats_faults(of_all, one, found)), one.texts
