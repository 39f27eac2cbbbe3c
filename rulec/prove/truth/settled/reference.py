"""Errors of the true model on held-out samples, by reading, and the unrecorded driver.

A tool predicts a reading from the others by a residual, the difference of two observers of a flow.
The same residual of the true laws, with true parameters and without systematic errors of sensors,
errs by the noise of all readings only. That is a little better than any refit.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..sealed import Reference, Request
from ..units import Array
from .operated_plant import SENSING, Scene
from .solve import Change, Operated, solve

STEP = 1e-5
ROUNDS = 30


def reference(
    scene: Scene, terms: tuple[Change, ...], unrecorded: str, request: Request, module: str
) -> Reference:
    """Return errors by signal in its unit, and the course of the unrecorded driver."""
    truth = scene.truly(terms)
    noisy = {name: value + _noise(scene, name, value) for name, value in truth.items()}
    errors = {
        signal: _error(scene, terms, truth, noisy, signal, relation, request)
        for signal, relation in request.relations.items()
    }
    driver = None
    if unrecorded:
        own = truth.get(f"{module}.{unrecorded}")
        course = scene.warmth if own is None else own
        driver = (scene.recorded_clock, course[scene.first :])
    return Reference(errors, driver)


def _noise(scene: Scene, place: str, value: Array) -> Array:
    """Noise of a reading, SI."""
    sensor = scene.rig.sensors[place]
    quiet = replace(SENSING, statistical=0.0)
    both = [scene.read(place, value, s) for s in (SENSING, quiet)]
    return np.asarray((both[0] - both[1]) * sensor.scale)


def _error(
    scene: Scene,
    terms: tuple[Change, ...],
    truth: Mapping[str, Array],
    noisy: Mapping[str, Array],
    signal: str,
    relation: str,
    request: Request,
) -> float:
    """RMS of predicted minus measured on held-out samples, in the sensor's unit."""
    laws = (*scene.hard.terms(scene.rig, scene.values), *terms)
    given = {**noisy, signal: truth[signal]}
    step = STEP * float(np.max(np.abs(truth[signal])))
    off, moved = (
        _relation(Operated(scene.rig, scene.values, readings, laws), scene.plain, relation)
        for readings in (given, {**given, signal: given[signal] + step})
    )
    with np.errstate(all="ignore"):
        predicted = truth[signal] - off * step / (moved - off)
    error = (predicted - noisy[signal])[scene.first :] / scene.rig.sensors[signal].scale
    used = scene.running[scene.first :] & np.isfinite(error)
    clock = scene.recorded_clock
    used &= np.any([(clock >= a) & (clock <= b) for a, b in request.heldout], axis=0)
    return float(np.sqrt(np.mean(error[used] ** 2))) if used.any() else float("nan")


def _relation(plant: Operated, plain: Mapping[str, Array], relation: str) -> Array:
    """The residual of a relation such as `A.pump-plant` or `M.power-resis`, m3/s.

    `plain` has the start of the root search.
    """
    module, _, pair = relation.partition(".")
    first, second = pair.split("-")
    if module in plant.rig.pumps:
        return _flow(plant, plain, module, first) - _flow(plant, plain, module, second)
    feeding = [m for m in plant.rig.pumps if module in plant.rig.path(m)]
    flows = [_flow(plant, plain, m, first) for m in feeding]
    return np.asarray(np.sum(flows, axis=0) - _flow(plant, plain, module, second))


def _flow(plant: Operated, plain: Mapping[str, Array], module: str, way: str) -> Array:
    """Net flow of a module by one observer with the true laws, m3/s."""
    rig, given = plant.rig, plant.given
    if way == "flow":
        return given[f"{module}.Q"]
    if rig.by_meter:
        # The reading over the value of the law, as in the tool's relation.
        read = f"{module}.{'dp' if way == 'head' else 'P_el'}"
        return np.asarray(given[f"{module}.Q"] * given[read] / solve(plant)[read])
    pressure = given[f"{module}.dp"]
    if way in ("plant", "resis"):
        rest = sum((given[f"{m}.dp"] for m in rig.path(module)), np.zeros_like(pressure))
        behind = rest if way == "plant" else np.zeros_like(pressure)
        return _through(plant, module, pressure - behind, behind)
    guess = plain.get(f"{module}.Q", np.zeros_like(pressure))
    flow, state = plant.delivered(module, pressure, guess)
    if way == "power":
        kind = rig.kind(module)
        inner = flow + plant.total("slip", module, state)
        law = state.power
        if not kind.rising:
            law = kind.power(plant.parameters(module), state.speed, pressure, inner)
        flow = flow * given[f"{module}.P_el"] / (law + plant.total("power", module, state))
    return plant.net(module, flow)


def _through(plant: Operated, name: str, loss: Array, behind: Array) -> Array:
    """Flow at a loss of a line or mixer, with a pressure behind it."""
    flow = np.sqrt(np.maximum(loss, 1.0) / plant.values[f"{name}.k2"])
    for _ in range(ROUNDS):
        step = 1e-6 * flow
        now = plant.line_loss(name, flow, behind)
        slope = (plant.line_loss(name, flow + step, behind) - now) / step
        flow = np.maximum(flow - (now - loss) / slope, 0.2 * flow)
    return flow
