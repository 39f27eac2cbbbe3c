"""What is seen at best of a plant that is made harder: form errors, coloured noise and drifts count
as random, each of the size that it has.

What is left between readings and a model without the effect has the covariance of noise with its
memory, of all parameters, of each sensor's error as it drifts, and of each law's form error where
the plant runs. An analyst who knows these covariances, but no value of them, cannot see more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from ..spread import drift_directions, form_directions
from ..units import Array
from ..whiten import Whitening
from .difficulty import term
from .scene import Scene
from .visible import RELATIVE, VisibleOutputs, class_of, noise_of, parameters_moved, slopes_of

Outputs = Mapping[str, Array]
"""By signal, SI, shape (n,)."""


def blurred(sharp: VisibleOutputs) -> VisibleOutputs:
    """The sight of a scene with difficulties as random terms; `sharp` takes form errors as known,
    noise as white, and drifts as none."""
    scene = sharp.scene
    slopes = slopes_of(scene)
    whitening = _whitening(sharp, slopes)
    columns = [np.stack([c[name] for name in scene.rig.outputs], 1) for c in _free(scene, slopes)]
    return replace(sharp, whitening=whitening, sensitivities=whitening(np.stack(columns, 2)))


def _whitening(sharp: VisibleOutputs, slopes: Mapping[str, Outputs]) -> Whitening:
    """Each output has the noise of its sensor, and what the noise of inputs makes of it."""
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


def _free(scene: Scene, slopes: Mapping[str, Outputs]) -> Iterator[Outputs]:
    """What all that is uncertain changes in the outputs, for a standard deviation each."""
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
    """What an error of each sensor of the size of its class changes."""
    zero = {name: np.zeros_like(scene.time) for name in scene.rig.outputs}
    for name in scene.rig.outputs:
        yield name, {**zero, name: class_of(scene, name)}
    for name in scene.rig.inputs:
        share = class_of(scene, name) / noise_of(scene, name)
        yield name, {output: slope * share for output, slope in slopes[name].items()}


def _form(scene: Scene, law: str) -> Iterator[Outputs]:
    """What the form error of a law may change, to first order at each operating point."""
    met: list[tuple[Array, ...]] = []
    change = _moved_by(scene, law, met)
    for course in form_directions(scene.hard.form[law], met[-1]).T:
        yield {name: values * course for name, values in change.items()}


def _moved_by(scene: Scene, law: str, met: list[tuple[Array, ...]]) -> Outputs:
    """Change of the outputs per share of a law; `met` gets the arguments that the law meets."""

    def form(*arguments: Array) -> Array:
        met.append(arguments)
        return np.full(np.shape(arguments[0]), RELATIVE)

    truth = scene.truly([term(scene.rig, scene.values, law, form)])
    return {name: (truth[name] - scene.plain[name]) / RELATIVE for name in scene.rig.outputs}
