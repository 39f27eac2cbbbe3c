"""The limit of detection of hard cases: form errors, coloured noise and drifts count as random,
each with its true size.

The residual of a model without the effect has the covariance of coloured noise, of all parameters,
of each sensor's drifting error, and of each law's form error where the plant runs. An analyst who
knows these covariances, but none of the values, cannot detect more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ..spread import drift_directions, form_directions
from ..units import Array
from ..whiten import Whitening
from .detection_limit import (
    RELATIVE,
    VisibleOutputs,
    class_of,
    noise_of,
    parameters_moved,
    slopes_of,
)
from .difficulty import term
from .operated_plant import Scene

Outputs = Mapping[str, Array]
"""By signal, SI, shape (n,)."""


def blurred(sharp: VisibleOutputs) -> VisibleOutputs:
    """Return the detectability with difficulties as random terms; `sharp` has known form errors,
    white noise and no drifts."""
    scene = sharp.scene
    slopes = slopes_of(scene)
    whitening = _whitening(sharp, slopes)
    changes = _uncertain(scene, slopes)
    columns = [np.stack([c[name] for name in scene.rig.outputs], 1) for c in changes]
    return replace(sharp, whitening=whitening, sensitivities=whitening(np.stack(columns, 2)))


def _whitening(sharp: VisibleOutputs, slopes: Mapping[str, Outputs]) -> Whitening:
    """Each output has the noise of its sensor, and that of the inputs."""
    scene, rig = sharp.scene, sharp.scene.rig
    sources = [*rig.outputs, *rig.inputs]
    sizes = np.zeros((scene.time.size, len(rig.outputs), len(sources)))
    for i, output in enumerate(rig.outputs):
        sizes[:, i, i] = noise_of(scene, output)
        for k, name in enumerate(rig.inputs, len(rig.outputs)):
            sizes[:, i, k] = slopes[name][output]
    colours = np.array([scene.hard.colour.get(name, 0.0) for name in sources])
    counts = np.stack([sharp.settled[name.partition(".")[0]] for name in rig.outputs], 1)
    return Whitening.of(sizes, colours, counts)


def _uncertain(scene: Scene, slopes: Mapping[str, Outputs]) -> Iterator[Outputs]:
    """Change of the outputs per standard deviation of everything that is uncertain."""
    yield from parameters_moved(scene)
    for place, change in _sensors(scene, slopes):
        drift = scene.hard.drift.get(place)
        if drift is None:
            yield change
            continue
        for course in drift_directions(drift, scene.time.size).T:
            yield {name: values * course for name, values in change.items()}
    for law in scene.hard.form:
        yield from _form(scene, law)


def _sensors(scene: Scene, slopes: Mapping[str, Outputs]) -> Iterator[tuple[str, Outputs]]:
    """Change of the outputs by each sensor's error of the size of its class."""
    zero = {name: np.zeros_like(scene.time) for name in scene.rig.outputs}
    for name in scene.rig.outputs:
        yield name, {**zero, name: class_of(scene, name)}
    for name in scene.rig.inputs:
        share = class_of(scene, name) / noise_of(scene, name)
        yield name, {output: slope * share for output, slope in slopes[name].items()}


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
