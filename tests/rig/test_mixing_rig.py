"""The measuring of the rig: figures of a small run, and that the counting itself is right."""

from pathlib import Path

import numpy as np
import pytest

from tests.dosing import RIGS
from tests.rig.mixing_rig.cases import EXPERIMENTS, FULL, PLANTS, QUICK
from tests.rig.mixing_rig.drawn import drawn
from tests.rig.mixing_rig.judge import Answer, run
from tests.rig.mixing_rig.measure import FORMS, counted, sample_figures, sound_form


def test_answers_are_counted() -> None:
    """Shares named first, and errors of those and of all that are named."""
    right, other = ("A.leakage", 0.21, 1.0), ("B.leakage", 0.3, 0.99)
    close = ("A.leakage", 0.23, 0.6)
    said = ((right,), (close, other), (other, close), (other,), ())
    found = counted([Answer("", "", 1, 0.2, {"A.leakage": 0.2}, named) for named in said])
    assert (2, 5) == (found["first"]["count"], found["first"]["of"])
    assert (0.02, 0.06) == pytest.approx((found["error"], found["error_any"]))


def test_size_of_the_full_runs() -> None:
    """At least 1200 stationary points of all faults, and 100,000 fault-free samples, no seed twice.
    540 recordings of abc, each fault and degree with ten calibrations; the fault begins with its
    plateau."""
    names = ("degrees", "alarms", "sound", "sound-start")
    degrees, alarms, sound, start = (EXPERIMENTS[name](FULL) for name in names)
    samples = [sum(t.case.run.operation.time.size for t in tasks) for tasks in (alarms, sound)]
    assert [100_000] * 2 == samples
    assert not any(t.case.faults for t in [*alarms, *sound])
    assert 1376 == sum(len(task.plateaus) for task in degrees)
    assert 540 == len(start)
    for tasks in ([*degrees, *alarms], start):
        assert len(tasks) == len({t.case.seed for t in tasks})
    cases: dict[str, set[int]] = {}
    for task in start:
        cases.setdefault(str(task.case.faults), set()).add(task.draw)
    assert {10} == {len(draws) for draws in cases.values()}
    ((begin, _),) = start[0].plateaus
    degree = start[0].case.run.faults[next(iter(start[0].case.faults))]
    assert np.all(degree[:begin] == 0.0)
    assert degree[begin + 1] > 0.0


@pytest.mark.prove
def test_quick_runs_are_right(tmp_path: Path) -> None:
    """Default mode names every plateau of leakage in both plants, within 0.02, and alarms at no
    other time, nor in a tour of a healthy rig with transients."""
    leakage, healthy = (
        run(tmp_path, EXPERIMENTS[name](QUICK), workers=1) for name in ("leakage", "alarms")
    )
    for plant in PLANTS:
        own = [a for a in leakage.answers if (a.group, a.mode) == (plant, "default")]
        default = counted(own)
        assert (3, 3) == (default["first"]["of"], default["first"]["count"])
        assert default["error"] < 0.02
        samples = [s for s in leakage.samples if (s.group, s.mode) == (plant, "default")]
        figures = sample_figures(samples, "A.leakage")
        assert 0.0 == figures["alarmed"]
        assert figures["error"] < 0.0027  # 0.0017, and two standard deviations between calibrations
    found = sound_form([c for c in healthy.covered if c.mode == "default"])
    counts = (found["fault"]["of"], found["fault"]["count"], found["unknown"]["count"])
    assert (80, 0, 0) == counts


def test_small_faults_are_named_and_sound_plants_are_sound(tmp_path: Path) -> None:
    """Each small fault once, of which at most one may hide: it once went from 0.98 to 0.86 and
    nobody saw it. And sound samples, none called faulty."""
    start, sound = (
        FORMS[name](run(tmp_path, EXPERIMENTS[name](QUICK), workers=1))
        for name in ("sound-start", "sound")
    )
    first = start["degree"]["0.1"]["first"]
    assert 18 == first["of"]
    assert first["count"] >= 17
    assert 0 == sound["default"]["fault"]["count"]


def test_a_drawn_plant_is_off_inside_its_uncertainty() -> None:
    """Another plant for each seed, the same for the same; what is exact stays."""
    plant = RIGS["abc"]
    sheet = {name: value for name, value in plant.values.items() if value}
    drawings = [drawn(plant, seed).values for seed in range(200)]
    assert drawings[7] == drawn(plant, 7).values
    off = np.array([[one[n] / value for n, value in sheet.items()] for one in drawings]) - 1.0
    spread, exact = off.std(axis=0), np.array([name.endswith(".V") for name in sheet])
    assert np.all((spread == 0.0) == exact)
    # The largest of 200 draws cut at two standard uncertainties; their spread is 0.88 of one.
    assert np.all(np.abs(off).max(axis=0)[~exact] < 2.0 / 0.7 * spread[~exact])
