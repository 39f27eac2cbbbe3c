"""Hard cases of tanks: form errors, noise with a memory, drifts, any start, few set values."""

from dataclasses import replace

import numpy as np
import pytest

from rulec.prove.truth.kinds import difficulties
from rulec.prove.truth.smooth import SIZE_OF_FORM, form_error
from rulec.prove.truth.streams import stream
from rulec.prove.truth.tanks.balance import integrate
from rulec.prove.truth.tanks.build import CASCADED, METER_SLOPE, Setup, build, recorded_input
from rulec.prove.truth.tanks.detection_limit import noise_of
from rulec.prove.truth.tanks.laws import outflow, supply
from rulec.prove.truth.tanks.plant import LEVEL_ZERO
from rulec.prove.truth.tanks.rows import row
from rulec.prove.truth.tanks.sensing import shown
from rulec.prove.truth.tanks.suite import HARD, cases

ALL = difficulties("tanks", "all")
METERED = next(r for r in map(row, range(20)) if r.metered)


def hard_setup(*difficulties: str, samples: int = 256, seed: int = 4) -> Setup:
    """The shipped plant with difficulties, at few set values."""
    return build(CASCADED, seed, samples, "few-values", difficulties)


def test_a_form_error_in_plain_numbers_is_the_one_that_was_drawn() -> None:
    """Over its range; beyond it, it stays."""
    form = form_error(stream(1, "form"), 0.01, ((0.0, 30.0),))
    levels = np.linspace(0.0, 30.0, 50)
    assert [form.at(float(v)) for v in levels] == pytest.approx(form(levels).tolist(), abs=1e-12)
    assert form.at(40.0) == form.at(30.0)


def test_every_outlet_and_the_pump_are_off_by_their_form_errors() -> None:
    """By 0.5 to 2 %; a flow meter has no law."""
    setup = hard_setup("form")
    for tank in setup.plant.tanks:
        assert tank.form is not None
        assert SIZE_OF_FORM[0] <= tank.form.rms <= SIZE_OF_FORM[1]
        off = outflow(tank, 9.0, 0.0, 0.0) / outflow(replace(tank, form=None), 9.0, 0.0, 0.0)
        assert off - 1.0 == pytest.approx(tank.form.at(9.0), abs=1e-12)
    feed = setup.plant.feed
    assert feed.form is not None
    off = supply(feed, 4.0) / supply(replace(feed, form=None), 4.0)
    assert off - 1.0 == pytest.approx(feed.form.at(4.0), abs=1e-12)
    assert build(METERED, 1, 40, "", ("form",)).plant.feed.form is None


def test_noise_has_the_memory_that_the_answer_states() -> None:
    """Of the reading of a level that stands still."""
    setup = hard_setup("coloured", samples=20)
    (sensor,) = setup.plant.sensors
    many = 20000
    still = replace(setup.course, time=np.arange(many * 1.0))
    still = replace(still, sensed=np.full((many, 1), 9.0), fallen=np.zeros((many, 2)))
    readings = (shown(setup.plant, still, seed)["lower"] for seed in (1, None))
    error = np.subtract(*readings)
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(sensor.colour, abs=0.04)
    assert error.std() == pytest.approx(noise_of(sensor), rel=0.05)
    assert setup.told == {"coloured": {"lower": sensor.colour}}


def test_sensors_drift_within_their_class() -> None:
    for seed in range(8):
        setup = build(METERED, seed, 60, "", ("drift",))
        still = tuple(replace(s, wander=None) for s in setup.plant.sensors)
        bare = replace(setup.plant, sensors=still)
        course = integrate(bare, setup.time, setup.shown)
        for sensor in setup.plant.sensors:
            off = shown(setup.plant, course)[sensor.tank] - shown(bare, course)[sensor.tank]
            assert np.abs(off + sensor.zero).max() <= 2.0 * LEVEL_ZERO + 1e-12
            assert np.ptp(off) > 0.0
        meter = recorded_input(setup, seed) / np.maximum(setup.shown, 1e-9) - 1.0
        running = setup.shown > 0.0
        assert np.abs(meter[running]).max() < (4.0 + 4.0 * 0.3) * METER_SLOPE


def test_few_values_are_set_again_and_again() -> None:
    given = hard_setup(samples=1024).shown
    values, visits = np.unique(given), np.count_nonzero(np.diff(given)) + 1
    assert 3 <= values.size <= 5
    assert visits > 2 * values.size


def test_tanks_begin_at_any_level() -> None:
    """Low and high, and no sensor begins where it cannot show."""
    setups = [hard_setup("starts", samples=10, seed=seed) for seed in range(30)]
    levels = np.array([[tank.level for tank in s.plant.tanks] for s in setups])
    assert np.ptp(levels[:, 0]) > 15.0
    assert all(s.plant.tanks[1].level * s.plant.sensors[0].gain <= 8.0 + 1e-9 for s in setups)


def test_the_suite_draws_tanks_of_all_groups() -> None:
    """Clean ones plant nothing, and are as hard as the others."""
    for case in cases(2, dict.fromkeys(HARD, 2)):
        assert case.difficulties
        assert bool(case.effects) != case.group.endswith("-clean")
    (clean,) = cases(1, {"all-clean": 1}, 256)
    answer = clean.make().answer
    assert answer.verdict == "none"
    assert set(ALL) >= set(answer.difficulties) > {"form", "coloured"}
