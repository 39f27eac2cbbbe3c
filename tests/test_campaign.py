"""Runs over operating points with transients do what they say."""

import numpy as np
import pytest

from tests import dosing as truth


def test_transients_follow_a_first_order_lag() -> None:
    """After a step what is left of it falls by exp(-t / time constant); sensors jump."""
    run = truth.settling(truth.fault_replay(truth.RIGS["abc"], "A.leakage", (0.0, 0.4)))
    expected = 0.4 * (1 - np.exp(-np.arange(1.0, 11.0) / truth.VALVE_TIME))
    assert [0.0] * 10 == run.faults["A.leakage"][:10].tolist()
    assert expected == pytest.approx(run.faults["A.leakage"][10:], rel=1e-12)
    jump = truth.settling(truth.fault_replay(truth.RIGS["abc"], "A.dp.high", (0.0, 0.4)))
    assert [0.0] * 10 + [0.4] * 10 == jump.faults["A.dp.high"].tolist()


def test_speed_approaches_the_next_operating_point() -> None:
    """Speeds move monotonously and end on what was set; the flow follows in the same sample."""
    plant = truth.RIGS["abc"]
    first, second = truth.operating_points(plant, 2)
    run = truth.settling(truth.visiting_run(plant, [first, second], {}))
    speed = run.operation.speed["A"]
    assert np.all(np.diff(speed[9:]) > 0)
    assert second["A"] == pytest.approx(speed[-1], rel=1e-4)
    found = truth.record(run, truth.NOISE_FREE).truth["A.Q [l/h]"]
    assert np.all(np.diff(found[9:]) > 0)


def test_transients_leave_no_trace_on_a_bench() -> None:
    """A bench run is set up point by point; to ask for its transients is refused."""
    with pytest.raises(ValueError, match="bench"):
        truth.settling(truth.calibration_run(truth.RIGS["abc"]))


def test_visits_to_operating_points() -> None:
    """A healthy lead-in at the first point, then all faults at every point."""
    plant = truth.RIGS["abc"]
    points = truth.operating_points(plant, 3)
    run = truth.visiting_run(plant, points, {"A.leakage": 0.3, "B.dp.high": 0.2}, lead_in=5, hold=4)
    assert [0.0] * 5 + [0.3] * 12 == run.faults["A.leakage"].tolist()
    assert [0.0] * 5 + [0.2] * 12 == run.faults["B.dp.high"].tolist()
    visited = [points[0]["B"]] * 9 + [points[1]["B"]] * 4 + [points[2]["B"]] * 4
    assert visited == run.operation.speed["B"].tolist()


@pytest.mark.parametrize("rig", truth.RIGS)
def test_operating_points_differ_and_lie_in_the_calibrated_range(rig: str) -> None:
    """The first point is nominal; no two are alike."""
    plant = truth.RIGS[rig]
    points = truth.operating_points(plant, 8)
    assert {name: module.speed for name, module in plant.modules.items()} == points[0]
    for name, module in plant.modules.items():
        speeds = [point[name] for point in points]
        assert 8 == len(set(speeds))
        assert module.slowest < min(speeds) < max(speeds) < module.fastest
