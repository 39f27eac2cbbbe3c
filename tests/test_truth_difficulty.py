"""What makes cases of the proof harder: form errors, noise with a memory, drifts, few states."""

import functools

import numpy as np
import pytest

from rulec.prove.truth.sensors import INSIDE, Sensing, read
from rulec.prove.truth.settled.effect_size import NEAR
from rulec.prove.truth.settled.operated_plant import Scene
from rulec.prove.truth.settled.plan import Planned
from rulec.prove.truth.settled.rig import PUMPS
from rulec.prove.truth.settled.suite import HARD, planned
from rulec.prove.truth.smooth import SIZE_OF_FORM, drift, form_error
from rulec.prove.truth.streams import stream


@functools.cache
def made(*difficulties: str, profile: str = "few-states") -> Scene:
    name = f"test {difficulties}"
    plan = Planned(name, "form-clean", "dosing", profile, small=True, difficulties=difficulties)
    return plan.make().scene


def test_a_form_error_has_the_size_that_was_asked_for() -> None:
    """Root mean square over its range; the mean is zero; smooth."""
    for seed in range(10):
        form = form_error(stream(seed, "form"), 0.01, ((2.0, 5.0), (0.0, 3e5)))
        speed, pressure = np.meshgrid(np.linspace(2, 5, 80), np.linspace(0, 3e5, 80))
        values = form(speed, pressure)
        assert values.std() == pytest.approx(0.01, rel=0.05)
        assert abs(values.mean()) < 0.001
        assert np.abs(np.diff(values, axis=1)).max() < 0.02


def test_laws_are_off_by_their_form_errors() -> None:
    """What a line loses differs from its formula by as much as the answer says, at each flow."""
    scene = made("form")
    # Flow or head, power and line of each pump, and each mixer.
    assert len(scene.hard.form) == 3 * len(scene.rig.pumps) + len(scene.rig.mixers)
    assert all(SIZE_OF_FORM[0] <= form.rms <= SIZE_OF_FORM[1] for form in scene.hard.form.values())
    for mixer in scene.rig.mixers:
        flow = np.sum([scene.plain[f"{m}.Q"] for m in scene.rig.pumps], axis=0)
        law = scene.values[f"{mixer}.k0"] + scene.values[f"{mixer}.k2"] * flow**2
        off = scene.plain[f"{mixer}.dp"] / law - 1.0
        assert off == pytest.approx(scene.hard.form[f"{mixer}.loss"](flow), abs=1e-9)
        assert 0.0 < np.abs(off).max() < 4 * SIZE_OF_FORM[1]


def test_a_metered_pump_has_form_errors_of_head_and_power() -> None:
    """It stands between two valves: there is no law of a line. What is seen at best is told."""
    plan = Planned(
        "metered", "all", "bench", "few-states", ("cavitation",), 2000.0, small=True,
        difficulties=("form", "coloured", "wobble", "drift"),
    )  # fmt: skip
    made = plan.make()
    laws = {f"{m}.{law}" for m in made.scene.rig.pumps for law in ("head", "power")}
    assert laws == set(made.scene.hard.form)
    assert 0.0 < made.answer.effects[0].gain < 2000.0 * NEAR


def test_readings_have_the_memory_that_the_answer_states() -> None:
    scene = made("coloured", profile="long-constant")
    for place, coefficient in scene.hard.colour.items():
        value = np.full(20000, float(scene.plain[place][0]))
        error = scene.read(place, value, Sensing(systematic=False))
        found = np.corrcoef(error[1:], error[:-1])[0, 1]
        assert found == pytest.approx(coefficient, abs=0.03)


def test_drift_stays_within_the_class() -> None:
    """From first to last sample, smooth, and it does drift."""
    sensor, value = PUMPS["cavity"].sensors["dp"], np.full(600, 3e5)
    quiet = Sensing(statistical=0.0, law=INSIDE.law)
    for seed in range(50):
        course = drift(stream(seed, "drift"))
        error = read(sensor, "A.dp", value, quiet, seed, drift=course) - sensor.shown(value)
        assert np.abs(error).max() <= sensor.bound * (1 + 1e-9)
        assert np.abs(np.diff(error)).max() < 0.05 * sensor.bound
        assert np.ptp(error) > 0.0


def test_a_plant_with_few_states_keeps_to_them() -> None:
    """Three to six, most samples at rest."""
    scene = made("form")
    module = next(iter(scene.rig.pumps))
    speed = scene.given[f"{module}.n"][scene.first :]
    rest = speed[1:][np.abs(np.diff(speed)) < 1e-6 * speed[1:]]
    assert 3 <= np.unique(np.round(rest, 3)).size <= 6
    assert rest.size > 0.6 * speed.size


def test_a_setting_wobbles_by_what_the_answer_states() -> None:
    """Over the range, between two like runs."""
    calm, moved = made(profile="steps"), made("wobble", profile="steps")
    assert not calm.hard.told
    assert set(moved.hard.told["wobble"]) == set(moved.rig.inputs)


def test_difficulties_stand_in_the_answer_and_are_no_effects() -> None:
    """A clean case with all of them is clean; of cases without them the answer is as it was."""
    for case in planned(1, {"all-clean": 1, "clean": 1}, small=True):
        answer = case.make().answer
        assert answer.verdict == "none"
        assert (case.group == "all-clean") == ("difficulties" in answer.to_json())


def test_the_suite_draws_all_groups_with_difficulties() -> None:
    for case in planned(2, dict.fromkeys(HARD, 2)):
        assert bool(case.difficulties) == (case.group != "wiring")
        assert bool(case.effects) != case.group.endswith("-clean")
