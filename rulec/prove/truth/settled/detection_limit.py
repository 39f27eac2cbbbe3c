"""The limit of detection of an effect: expected gain in log likelihood over recalibration.

Laws count as linear in the parameters, samples as independent: a bound that no tool reaches.
Sensors' systematic errors and all parameters are free within their uncertainties. A sample counts
if its module is settled, as the model describes settled operation only.

In hard cases the residual of a model without the effect has the covariance of coloured noise, of
all parameters, of each sensor's drifting error, and of each law's form error where the plant runs,
each with its true size. An analyst who knows these covariances, but none of the values, cannot
detect more.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..detection_limit import expected_gain
from ..smooth import drift_directions, form_directions
from ..units import Array
from ..whiten import Whitening
from .difficulty import term
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
    whitening : of coloured noise, shared by outputs; None for white noise
    """

    scene: Scene
    noise: Mapping[str, Array]
    sensitivities: Array
    settled: Mapping[str, np.ndarray]
    whitening: Whitening | None = None

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
        if self.whitening is not None:
            outputs = np.stack([values[n] for n in self.scene.rig.outputs], 1)
            return self.whitening(outputs[:, :, None])[:, 0]
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
    changes = [*parameters_moved(scene), *(change for _, change in sensors_moved(scene, slopes))]
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


def sensors_moved(scene: Scene, slopes: Mapping[str, Outputs]) -> Iterator[tuple[str, Outputs]]:
    """Yield the change of the outputs by each sensor's error of the size of its class."""
    zero = {name: np.zeros_like(scene.time) for name in scene.rig.outputs}
    for name in scene.rig.outputs:
        yield name, {**zero, name: class_of(scene, name)}
    for name in scene.rig.inputs:
        yield name, {n: slope / SENSING.statistical for n, slope in slopes[name].items()}


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


def blurred(sharp: VisibleOutputs) -> VisibleOutputs:
    """Return the detectability with difficulties as random terms; `sharp` has known form errors,
    white noise and no drifts."""
    scene, rig, slopes = sharp.scene, sharp.scene.rig, slopes_of(sharp.scene)
    # Each output has the noise of its sensor, and that of the inputs.
    sources = [*rig.outputs, *rig.inputs]
    sizes = np.zeros((scene.time.size, len(rig.outputs), len(sources)))
    for i, output in enumerate(rig.outputs):
        sizes[:, i, i] = noise_of(scene, output)
        for k, name in enumerate(rig.inputs, len(rig.outputs)):
            sizes[:, i, k] = slopes[name][output]
    colours = np.array([scene.hard.colour.get(name, 0.0) for name in sources])
    counts = np.stack([sharp.settled[name.partition(".")[0]] for name in rig.outputs], 1)
    whitening = Whitening.of(sizes, colours, counts)
    changes = _uncertain(scene, slopes)
    columns = [np.stack([c[name] for name in rig.outputs], 1) for c in changes]
    return replace(sharp, whitening=whitening, sensitivities=whitening(np.stack(columns, 2)))


def _uncertain(scene: Scene, slopes: Mapping[str, Outputs]) -> Iterator[Outputs]:
    """Change of the outputs per standard deviation of everything that is uncertain."""
    yield from parameters_moved(scene)
    for place, change in sensors_moved(scene, slopes):
        drift = scene.hard.drift.get(place)
        if drift is None:
            yield change
            continue
        for course in drift_directions(drift, scene.time.size).T:
            yield {name: values * course for name, values in change.items()}
    for law in scene.hard.form:
        yield from _form(scene, law)


def _form(scene: Scene, law: str) -> Iterator[Outputs]:
    """Change of the outputs by the form error of a law, to first order at each operating point."""
    met: list[tuple[Array, ...]] = []

    def form(*arguments: Array) -> Array:
        met.append(arguments)
        return np.full(np.shape(arguments[0]), RELATIVE)

    truth = scene.truly([term(scene.rig, scene.values, law, form)])
    change = {name: (truth[name] - scene.plain[name]) / RELATIVE for name in scene.rig.outputs}
    for course in form_directions(scene.hard.form[law], met[-1]).T:
        yield {name: values * course for name, values in change.items()}
