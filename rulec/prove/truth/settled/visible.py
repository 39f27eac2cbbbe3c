"""How visible an effect is at best: expected gain in log likelihood over recalibration.

Laws count as linear in the parameters, samples as independent (`blurred` has what hard cases
need): a bound, not what a tool reaches.
Sensors' systematic errors and all parameters are free within their uncertainties. A sample counts
where its module is settled: of a reading that moves, a model of settled operation says nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..limit import expected_gain
from ..units import Array
from ..whiten import Whitening
from .scene import SENSING, Scene
from .term import Change

RELATIVE = 1e-4
"""Part of an uncertainty by which a parameter is moved to find its slope."""


@dataclass(frozen=True)
class VisibleOutputs:
    """What is seen of a scene: noise of each output, and how all that is uncertain changes it.

    Attributes
    ----------
    noise : by output, SI, shape (n,); that of the inputs included
    settled : by module, shape (n,)
    sensitivities : shape (outputs*n, k), over the noise
    whitening : of noise with a memory, shared by outputs; None for noise of each sample alone
    """

    scene: Scene
    noise: Mapping[str, Array]
    sensitivities: Array
    settled: Mapping[str, np.ndarray]
    whitening: Whitening | None = None

    def change(self, terms: Sequence[Change]) -> Array:
        """What terms change in the readings, over the noise; shape (outputs*n,)."""
        scene = self.scene
        shown = scene.shown(scene.truly(terms), terms)
        own = self.over({n: shown[n] - scene.plain[n] for n in scene.rig.outputs})
        # A wrong input moves what a model expects of all outputs.
        for name in scene.rig.inputs:
            off = shown[name] - scene.given[name]
            if np.any(off):
                own = own - self._moved(name, off)
        return own

    def gain(self, terms: Sequence[Change], flat: Array | None = None) -> float:
        """Expected gain of a model with the terms."""
        none = np.zeros((len(self.sensitivities), 0))
        free = none if flat is None else flat
        return expected_gain(self.change(terms), self.sensitivities, free)

    def _moved(self, name: str, off: Array) -> Array:
        return self.over(_outputs_moved(self.scene, name, off))

    def over(self, values: Mapping[str, Array]) -> Array:
        """What of changed outputs, SI, by signal, is seen, over the noise; shape (outputs*n,)."""
        if self.whitening is not None:
            outputs = np.stack([values[n] for n in self.scene.rig.outputs], 1)
            return self.whitening(outputs[:, :, None])[:, 0]
        parts = [
            (values[n] / self.noise[n])[self.settled[n.partition(".")[0]]]
            for n in self.scene.rig.outputs
        ]
        return np.concatenate(parts)


def sight(scene: Scene) -> VisibleOutputs:
    """Find slopes by differences."""
    rig = scene.rig
    variance: dict[str, Any] = {n: noise_of(scene, n) ** 2 for n in rig.outputs}
    slopes = slopes_of(scene)
    for name in rig.inputs:
        for output in rig.outputs:
            variance[output] = variance[output] + slopes[name][output] ** 2
    noise = {n: np.sqrt(v) for n, v in variance.items()}
    settled = settled_of(scene)
    bare = VisibleOutputs(scene, noise, np.zeros((0, 0)), settled)
    columns = [bare.over(change) for change in parameters_moved(scene)]
    zero = {n: np.zeros_like(scene.time) for n in rig.outputs}
    for name in rig.outputs:
        columns.append(bare.over({**zero, name: class_of(scene, name)}))
    for name in rig.inputs:
        shift = {n: v / SENSING.statistical for n, v in slopes[name].items()}
        columns.append(bare.over(shift))
    return VisibleOutputs(scene, noise, np.stack(columns, 1), settled)


def slopes_of(scene: Scene) -> dict[str, dict[str, Array]]:
    """What the noise of each input changes in the outputs, per standard deviation of a sample."""
    return {name: _outputs_moved(scene, name, noise_of(scene, name)) for name in scene.rig.inputs}


def parameters_moved(scene: Scene) -> Iterator[dict[str, Array]]:
    """What each uncertain parameter changes in the outputs, per standard uncertainty."""
    for name, (_, spread) in scene.rig.numbers.items():
        if spread > 0:
            step = RELATIVE * spread
            moved = scene.truly(values={**scene.values, name: scene.values[name] + step})
            yield {n: (moved[n] - scene.plain[n]) / RELATIVE for n in scene.rig.outputs}


def settled_of(scene: Scene) -> dict[str, np.ndarray]:
    """By module the samples of the recording, shape (n,), at which none of its readings moves from
    one to the next by more than its class."""
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
    """Standard deviation of a sample's error, SI, shape (n,)."""
    sensor = scene.rig.sensors[place]
    bound = sensor.bound * (np.abs(sensor.shown(scene.plain[place])) if sensor.relative else 1.0)
    size = SENSING.statistical * 0.5 * bound * sensor.scale
    return np.asarray(size * np.ones_like(scene.time))


def class_of(scene: Scene, place: str) -> Array:
    """Standard deviation of what all readings of a sensor share, SI, shape (n,)."""
    return noise_of(scene, place) / SENSING.statistical


def _outputs_moved(scene: Scene, name: str, off: Array) -> dict[str, Array]:
    """Change of all outputs if an input is moved, to first order."""
    step = 1e-3 if np.max(np.abs(off)) > 0 else 0.0
    given = {**scene.given, name: scene.given[name] + step * off}
    moved = replace(scene, given=given).truly()
    return {n: (moved[n] - scene.plain[n]) / max(step, 1e-300) for n in scene.rig.outputs}
