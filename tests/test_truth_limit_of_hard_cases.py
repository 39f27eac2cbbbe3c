"""What can be seen at best of hard cases: random form errors, coloured noise, drifts."""

from dataclasses import replace

import numpy as np
import pytest

from rulec.prove.truth.detection_limit import Measure
from rulec.prove.truth.sensors import Sensing
from rulec.prove.truth.settled.detection_limit import VisibleOutputs, blurred, visible_outputs
from rulec.prove.truth.settled.difficulty import term
from rulec.prove.truth.settled.effect import EFFECTS, Placed
from rulec.prove.truth.settled.effect_size import made_of
from rulec.prove.truth.settled.operated_plant import Scene
from rulec.prove.truth.settled.plan import Planned
from rulec.prove.truth.smooth import Drift, drift_directions, form_directions, form_error
from rulec.prove.truth.streams import stream
from rulec.prove.truth.units import Array
from rulec.prove.truth.whiten import Whitening

FEW, MANY = 50, 150
"""Plants that are drawn in every run, and in `make prove`."""


def hard_scene(*difficulties: str) -> Scene:
    name = f"limit {difficulties}"
    plan = Planned(
        name, "form-clean", "dosing", "few-states", small=True, difficulties=difficulties
    )
    return plan.make().scene


def some_change(seen: VisibleOutputs) -> Array:
    """What a line with another exponent changes, over the noise."""
    module = next(iter(seen.scene.rig.pumps))
    return seen.change(made_of(seen.scene, Placed(EFFECTS["exponent"], module), 0.05, 1).changes)


def test_whitened_noise_is_independent_with_variance_one() -> None:
    """Against the covariance of all samples; some are not seen."""
    random, n = stream(1, "whiten"), 40
    sizes = random.uniform(0.5, 2.0, (n, 3, 5)) * (random.uniform(size=(n, 3, 5)) < 0.7)
    sizes[:, range(3), range(3)] = random.uniform(0.5, 1.0, (n, 3))
    colours = np.array([0.9, 0.0, 0.5, 0.7, 0.0])
    seen = random.uniform(size=(n, 3)) < 0.8
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    memory = np.stack([c**lag if c else np.eye(n) for c in colours])
    covariance = np.einsum("tis,sut,ujs->tiuj", sizes, memory, sizes).reshape(3 * n, 3 * n)
    flat = seen.ravel()
    matrix = Whitening.of(sizes, colours, seen)(np.eye(3 * n).reshape(n, 3, 3 * n))[:, flat]
    white = matrix @ covariance[np.ix_(flat, flat)] @ matrix.T
    assert np.abs(white - np.eye(int(flat.sum()))).max() < 1e-9


@pytest.mark.parametrize("arguments", [1, 2])
def test_form_errors_spread_as_they_are_drawn(arguments: int) -> None:
    """Covariance at some points, against form errors drawn anew."""
    random = stream(2, "form")
    ranges = ((2.0, 5.0), (0.0, 3e5))[:arguments]
    points = tuple(random.uniform(low, high, 12) for low, high in ranges)
    drawn = np.stack([form_error(random, 0.01, ranges)(*points) for _ in range(2000)], 1)
    directions = form_directions(form_error(random, 0.01, ranges), points)
    off = directions @ directions.T - drawn @ drawn.T / drawn.shape[1]
    assert np.abs(off).max() < 0.15 * 0.01**2
    assert np.sqrt(np.mean(off**2)) < 0.05 * 0.01**2


def test_a_drift_is_the_sum_of_its_directions() -> None:
    drift = Drift(0.6, np.array([1.2, -0.7]))
    weights = np.array([0.4, *drift.draws])
    assert drift_directions(drift, 90) @ weights == pytest.approx(drift(0.4, 90))


@pytest.mark.parametrize("draws", [FEW, pytest.param(MANY, marks=pytest.mark.prove)])
def test_the_best_test_scatters_as_its_strength_says(draws: int) -> None:
    """Plants of the same make with other parameters, form errors, drifts and noise, all solved.

    The best linear test for an effect that is not there has a variance of twice the strength; what
    takes form errors as known and noise as white is far off.
    """
    scene = hard_scene("form", "coloured", "drift")
    sharp = visible_outputs(scene)
    soft = blurred(sharp)
    found = [_left_over(scene, number) for number in range(draws)]
    spreads = {}
    for name, seen in (("sharp", sharp), ("soft", soft)):
        change = some_change(seen)
        measure = Measure.beside(seen.sensitivities, np.zeros((change.size, 0)))
        scores = [measure.product(change, seen.over(left)) for left in found]
        spreads[name] = float(np.std(scores) / np.sqrt(2.0 * measure.gain(change)))
    assert spreads["soft"] == pytest.approx(1.0, abs=0.2)
    assert spreads["sharp"] > 3.0


def _left_over(scene: Scene, number: int) -> dict[str, Array]:
    """Readings of one plant of the same make, less the model at the inputs shown, SI."""
    random, rig = stream(number, "another plant"), scene.rig
    values = {
        n: scene.values[n] + u * random.standard_normal() for n, (_, u) in rig.numbers.items()
    }
    forms = [
        term(rig, values, law, form_error(random, form.rms, form.ranges))
        for law, form in scene.hard.form.items()
    ]
    truth = scene.truly(forms, values)
    drifts = {
        place: replace(one, draws=random.standard_normal(one.draws.size))
        for place, one in scene.hard.drift.items()
    }
    other = replace(scene, seed=number, hard=replace(scene.hard, drift=drifts))
    shown = {}
    for place in (*rig.outputs, *rig.inputs):
        sensor = rig.sensors[place]
        shown[place] = sensor.offset + sensor.scale * other.read(place, truth[place], Sensing())
    model = replace(scene, given={name: shown[name] for name in rig.inputs}).truly()
    return {name: shown[name] - model[name] for name in rig.outputs}


@pytest.mark.parametrize("difficulty", ["form", "coloured", "drift"])
def test_a_difficulty_hides_a_part_of_an_effect(difficulty: str) -> None:
    """Less is left of the gain than where the same plant has the difficulty and it is known."""
    scene = hard_scene(difficulty)
    known = {law: replace(form, rms=1e-6 * form.rms) for law, form in scene.hard.form.items()}
    easy = replace(scene, hard=replace(scene.hard, form=known, colour={}, drift={}))
    assert (
        0.0 < _gain(blurred(visible_outputs(scene))) < 0.95 * _gain(blurred(visible_outputs(easy)))
    )


def _gain(seen: VisibleOutputs) -> float:
    change = some_change(seen)
    return Measure.beside(seen.sensitivities, np.zeros((change.size, 0))).gain(change)
