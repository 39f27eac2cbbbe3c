"""The limit of detection of an effect: expected gain in log likelihood over recalibration.

Laws count as linear in the parameters, samples as independent: a bound that no tool reaches.
Sensors' systematic errors and all parameters are free within their uncertainties. A sample counts
if its module is settled, as the model describes settled operation only.

Difficulties of hard cases count as known: what they hide of an effect is not made up for.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..detection_limit import expected_gain
from ..units import Array
from .operated_plant import SENSING, Scene
from .solve import Term

RELATIVE = 1e-4
"""Share of an uncertainty by which a parameter is moved for its derivative."""


@dataclass(frozen=True)
class VisibleOutputs:
    """The outputs of a scene: their noise, and their changes by everything uncertain.

    Attributes
    ----------
    noise : by output, SI, shape (n,), including that of the inputs
    settled : by module, shape (n,)
    sensitivities : shape (outputs*n, k), over the noise
    """

    scene: Scene
    noise: Mapping[str, Array]
    settled: Mapping[str, np.ndarray]
    sensitivities: Array

    def change(self, terms: Sequence[Term]) -> Array:
        """Return the change of the readings by terms, over the noise; shape (outputs*n,)."""
        scene = self.scene
        shown = scene.shown(scene.truly(terms), terms)
        own = self.over({n: shown[n] - scene.plain[n] for n in scene.rig.outputs})
        # A wrong input changes the model's expectation of all outputs.
        for name in scene.rig.inputs:
            off = shown[name] - scene.given[name]
            if np.any(off):
                own = own - self.over(_outputs_moved(scene, name, off))
        return own

    def gain(self, terms: Sequence[Term], others: Sequence[Sequence[Term]] = ()) -> float:
        """Return the expected gain of a model with the terms, while others may have any size."""
        flat = np.zeros((len(self.sensitivities), 0))
        if others:
            flat = np.stack([self.change(other) for other in others], 1)
        return expected_gain(self.change(terms), self.sensitivities, flat)

    def over(self, values: Mapping[str, Array]) -> Array:
        """Return changes of outputs, SI, by signal, over the noise; shape (outputs*n,)."""
        parts = [
            (values[n] / self.noise[n])[self.settled[n.partition(".")[0]]]
            for n in self.scene.rig.outputs
        ]
        return np.concatenate(parts)


def visible_outputs(scene: Scene) -> VisibleOutputs:
    """Return the detectability in a scene; derivatives are finite differences.

    Sensitivities are to each parameter, per standard uncertainty, and to each sensor's error of the
    size of its class.
    """
    rig, moved = scene.rig, []
    own = {place: noise_of(scene, place) for place in (*rig.outputs, *rig.inputs)}
    slopes = [_outputs_moved(scene, name, own[name]) for name in rig.inputs]
    noise = {n: np.sqrt(sum((s[n] ** 2 for s in slopes), own[n] ** 2)) for n in rig.outputs}
    for name, (_, u) in rig.numbers.items():
        if u > 0:
            values = {**scene.values, name: scene.values[name] + RELATIVE * u}
            found = scene.truly(values=values)
            moved.append({n: (found[n] - scene.plain[n]) / RELATIVE for n in rig.outputs})
    zero = {name: np.zeros_like(scene.time) for name in rig.outputs}
    moved += [{**zero, name: own[name] / SENSING.statistical} for name in rig.outputs]
    moved += [{n: s[n] / SENSING.statistical for n in rig.outputs} for s in slopes]
    bare = VisibleOutputs(scene, noise, settled_of(scene), np.zeros((0, 0)))
    return replace(bare, sensitivities=np.stack([bare.over(change) for change in moved], 1))


def settled_of(scene: Scene) -> dict[str, np.ndarray]:
    """Return the settled samples of the recording by module, shape (n,): none of its readings
    changes from one sample to the next by more than its class."""
    running = scene.running.copy()
    running[: scene.first] = False
    found: dict[str, np.ndarray] = {}
    for place in scene.rig.sensors:
        rests = found.setdefault(place.partition(".")[0], running.copy())
        if place in scene.plain and not place.endswith((".T", ".l")):
            class_ = noise_of(scene, place) / SENSING.statistical
            moves = np.abs(np.diff(scene.plain[place])) > class_[1:]
            rests[1:] &= ~moves
            rests[:-1] &= ~moves
    return found


def noise_of(scene: Scene, place: str) -> Array:
    """Return the standard deviation of a sample's error, SI, shape (n,)."""
    sensor = scene.rig.sensors[place]
    bound = sensor.bound * (np.abs(sensor.shown(scene.plain[place])) if sensor.relative else 1.0)
    size = SENSING.statistical * 0.5 * bound * sensor.scale
    return np.asarray(size * np.ones_like(scene.time))


def _outputs_moved(scene: Scene, name: str, off: Array) -> dict[str, Array]:
    """Change of all outputs by that of an input, to first order."""
    step = 1e-3 if np.max(np.abs(off)) > 0 else 0.0
    moved = replace(scene, given={**scene.given, name: scene.given[name] + step * off}).truly()
    return {n: (moved[n] - scene.plain[n]) / max(step, 1e-300) for n in scene.rig.outputs}
