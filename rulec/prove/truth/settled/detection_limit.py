"""The limit of detection of an effect: expected gain in log likelihood over recalibration.

Laws count as linear in the parameters, samples as independent: a bound that no tool reaches.
Sensors' systematic errors and all parameters are free within their uncertainties. A sample counts
if its module is settled, as the model describes settled operation only.

Difficulties of hard cases count as known: what they hide of an effect is not made up for.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..detection_limit import expected_gain
from ..units import Array
from .operated_plant import SENSING, Scene
from .solve import Change

RELATIVE = 1e-4
"""Share of an uncertainty by which a parameter is moved for its derivative."""


Outputs = Mapping[str, Array]
"""By signal, SI, shape (n,)."""


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
    sensitivities: Array
    settled: Mapping[str, np.ndarray]

    def change(self, terms: Sequence[Change]) -> Array:
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

    def gain(self, terms: Sequence[Change], flat: Array | None = None) -> float:
        """Return the expected gain of a model with the terms."""
        if flat is None:
            flat = np.zeros((len(self.sensitivities), 0))
        return expected_gain(self.change(terms), self.sensitivities, flat)

    def over(self, values: Mapping[str, Array]) -> Array:
        """Return changes of outputs, SI, by signal, over the noise; shape (outputs*n,)."""
        parts = [
            (values[n] / self.noise[n])[self.settled[n.partition(".")[0]]]
            for n in self.scene.rig.outputs
        ]
        return np.concatenate(parts)


def visible_outputs(scene: Scene) -> VisibleOutputs:
    """Return the detectability in a scene; derivatives are finite differences."""
    rig, slopes = scene.rig, slopes_of(scene)
    noise = {}
    for output in rig.outputs:
        variance: Any = noise_of(scene, output) ** 2
        for name in rig.inputs:
            variance = variance + slopes[name][output] ** 2
        noise[output] = np.sqrt(variance)
    bare = VisibleOutputs(scene, noise, np.zeros((0, 0)), settled_of(scene))
    changes = [*parameters_moved(scene), *sensors_moved(scene, slopes)]
    return replace(bare, sensitivities=np.stack([bare.over(change) for change in changes], 1))


def slopes_of(scene: Scene) -> dict[str, dict[str, Array]]:
    """Return the change of the outputs per standard deviation of each input's noise."""
    return {name: _outputs_moved(scene, name, noise_of(scene, name)) for name in scene.rig.inputs}


def parameters_moved(scene: Scene) -> Iterator[dict[str, Array]]:
    """Yield the change of the outputs per standard uncertainty of each parameter."""
    for name, (_, spread) in scene.rig.numbers.items():
        if spread > 0:
            step = RELATIVE * spread
            moved = scene.truly(values={**scene.values, name: scene.values[name] + step})
            yield {n: (moved[n] - scene.plain[n]) / RELATIVE for n in scene.rig.outputs}


def sensors_moved(scene: Scene, slopes: Mapping[str, Outputs]) -> Iterator[Outputs]:
    """Yield the change of the outputs by each sensor's error of the size of its class."""
    zero = {name: np.zeros_like(scene.time) for name in scene.rig.outputs}
    for name in scene.rig.outputs:
        yield {**zero, name: class_of(scene, name)}
    for name in scene.rig.inputs:
        yield {n: slope / SENSING.statistical for n, slope in slopes[name].items()}


def settled_of(scene: Scene) -> dict[str, np.ndarray]:
    """Return the settled samples of the recording by module, shape (n,): none of its readings
    changes from one sample to the next by more than its class."""
    seen = scene.running.copy()
    seen[: scene.first] = False
    found: dict[str, np.ndarray] = {}
    for place in scene.rig.sensors:
        module = place.partition(".")[0]
        rests = found.setdefault(module, seen.copy())
        if place in scene.plain and not place.endswith((".T", ".l")):
            moves = np.abs(np.diff(scene.plain[place])) > class_of(scene, place)[1:]
            rests[1:] &= ~moves
            rests[:-1] &= ~moves
    return found


def noise_of(scene: Scene, place: str) -> Array:
    """Return the standard deviation of a sample's error, SI, shape (n,)."""
    sensor = scene.rig.sensors[place]
    bound = sensor.bound * (np.abs(sensor.shown(scene.plain[place])) if sensor.relative else 1.0)
    size = SENSING.statistical * 0.5 * bound * sensor.scale
    return np.asarray(size * np.ones_like(scene.time))


def class_of(scene: Scene, place: str) -> Array:
    """Return the standard deviation of a sensor's systematic error, SI, shape (n,)."""
    return noise_of(scene, place) / SENSING.statistical


def _outputs_moved(scene: Scene, name: str, off: Array) -> dict[str, Array]:
    """Change of all outputs by that of an input, to first order."""
    step = 1e-3 if np.max(np.abs(off)) > 0 else 0.0
    given = {**scene.given, name: scene.given[name] + step * off}
    moved = replace(scene, given=given).truly()
    return {n: (moved[n] - scene.plain[n]) / max(step, 1e-300) for n in scene.rig.outputs}
