"""Runs over operating points with transients, and campaigns of them, do what they say."""

import numpy as np
import pytest

from rulec.prove.truth import (
    INSIDE,
    NOISE_FREE,
    RIGS,
    VALVE_TIME,
    abc,
    calibration_run,
    fault_replay,
    mixing_rig,
    operating_points,
    possible_faults,
    record,
    settling,
    visiting_run,
)
from tests.campaign import campaign, published_faults, single_faults


def test_transients_follow_a_first_order_lag() -> None:
    """After a step what is left of it falls by exp(-t / time constant); sensors jump."""
    run = settling(fault_replay(abc(), "A.leakage", (0.0, 0.4)))
    expected = 0.4 * (1 - np.exp(-np.arange(1.0, 11.0) / VALVE_TIME))
    assert [0.0] * 10 == run.faults["A.leakage"][:10].tolist()
    assert expected == pytest.approx(run.faults["A.leakage"][10:], rel=1e-12)
    jump = settling(fault_replay(abc(), "A.dp.high", (0.0, 0.4))).faults["A.dp.high"]
    assert [0.0] * 10 + [0.4] * 10 == jump.tolist()


def test_speed_approaches_the_next_operating_point() -> None:
    """Speeds move monotonously and end on what was set; the flow follows in the same sample."""
    plant = abc()
    first, second = operating_points(plant, 2)
    run = settling(visiting_run(plant, [first, second], {}))
    speed = run.operation.speed["A"]
    assert np.all(np.diff(speed[9:]) > 0)
    assert second["A"] == pytest.approx(speed[-1], rel=1e-4)
    truth = record(run, NOISE_FREE).truth["A.Q [l/h]"]
    assert np.all(np.diff(truth[9:]) > 0)


def test_transients_leave_no_trace_on_a_bench() -> None:
    """A bench run is set up point by point; to ask for its transients is refused."""
    with pytest.raises(ValueError, match="bench"):
        settling(calibration_run(abc()))


def test_visits_to_operating_points() -> None:
    """A healthy lead-in at the first point, then all faults at every point."""
    plant = abc()
    points = operating_points(plant, 3)
    run = visiting_run(plant, points, {"A.leakage": 0.3, "B.dp.high": 0.2}, lead_in=5, hold=4)
    assert [0.0] * 5 + [0.3] * 12 == run.faults["A.leakage"].tolist()
    assert [0.0] * 5 + [0.2] * 12 == run.faults["B.dp.high"].tolist()
    visited = [points[0]["B"]] * 9 + [points[1]["B"]] * 4 + [points[2]["B"]] * 4
    assert visited == run.operation.speed["B"].tolist()


@pytest.mark.parametrize("rig", RIGS)
def test_operating_points_differ_and_lie_in_the_calibrated_range(rig: str) -> None:
    """The first point is nominal; no two are alike."""
    plant = RIGS[rig]()
    points = operating_points(plant, 8)
    assert {name: module.speed for name, module in plant.modules.items()} == points[0]
    for name, module in plant.modules.items():
        speeds = [point[name] for point in points]
        assert 8 == len(set(speeds))
        assert module.slowest < min(speeds) < max(speeds) < module.fastest


def test_published_faults() -> None:
    """Seven per dosing module and four per mixer: 18 of abc, 43 of the rig."""
    assert (18, 43) == (len(published_faults(abc())), len(published_faults(mixing_rig())))
    assert set(published_faults(mixing_rig())) <= set(possible_faults(mixing_rig()))


def test_campaign_of_the_rig_can_be_run() -> None:
    """All 43 faults at 0.8 on four operating points: every pump lifts; seeds are all different."""
    plant = mixing_rig()
    visits = [[point] for point in operating_points(plant, 4)]
    cases = campaign(plant, single_faults(plant, (0.8,)), visits, first_seed=100)
    assert list(range(100, 100 + 43 * 4)) == [case.seed for case in cases]
    for case in cases:
        (fault,) = case.faults
        degree = record(case.run, INSIDE, case.seed).truth[f"{fault} [1]"]
        assert 0.8 == pytest.approx(degree[-1], abs=0.002)
        assert 0.0 == degree[9]
