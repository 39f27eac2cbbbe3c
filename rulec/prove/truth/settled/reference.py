"""What the true model makes of held-out samples, reading by reading, and the unrecorded driver.

A tool predicts a reading from the others by one relation between two ways to tell a flow. The same
relation of the true laws, with their true parameters and with sensors' lasting errors taken out,
errs by the noise of all readings alone. That is a little better than any refit can be.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..sealed import Reference, Request
from ..sensors import Sensing, read
from ..units import Array
from .rig import delivered, leak, line_loss, of_module
from .scene import SENSING, Scene
from .term import Change, total

STEP = 1e-5
ROUNDS = 30


def reference(
    scene: Scene, terms: tuple[Change, ...], unrecorded: str, request: Request, module: str
) -> Reference:
    """Errors by signal in its unit, and the course of what is not recorded."""
    truth = scene.truly(terms)
    noisy = {name: value + _noise(scene, name, value) for name, value in truth.items()}
    errors = {
        signal: _error(scene, terms, truth, noisy, signal, relation, request)
        for signal, relation in request.relations.items()
    }
    driver = None
    if unrecorded:
        own = truth.get(f"{module}.{unrecorded}")
        course = next(iter(scene.temperature.values())) if own is None else own
        driver = (_clock(scene), course[scene.first :])
    return Reference(errors, driver)


def _clock(scene: Scene) -> Array:
    return np.arange(scene.time.size - scene.first, dtype=np.float64)


def _noise(scene: Scene, place: str, value: Array) -> Array:
    """What the noise of a sample adds to a reading, SI."""
    sensor = scene.rig.sensors[place]
    quiet = Sensing(SENSING.systematic, 0.0, SENSING.quantised, SENSING.law)
    both = [read(sensor, place, value, s, scene.seed) for s in (SENSING, quiet)]
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
    """Root mean square of predicted less measured on held-out samples, in the sensor's unit."""
    given = {**noisy, signal: truth[signal]}
    step = STEP * float(np.max(np.abs(truth[signal])))
    off = _relation(scene, terms, given, relation)
    moved = _relation(scene, terms, {**given, signal: given[signal] + step}, relation)
    with np.errstate(all="ignore"):
        predicted = truth[signal] - off * step / (moved - off)
    error = (predicted - noisy[signal])[scene.first :] / scene.rig.sensors[signal].scale
    used = scene.running[scene.first :] & np.isfinite(error)
    clock = _clock(scene)
    used &= np.any([(clock >= a) & (clock <= b) for a, b in request.heldout], axis=0)
    return float(np.sqrt(np.mean(error[used] ** 2))) if used.any() else float("nan")


def _relation(
    scene: Scene, terms: tuple[Change, ...], given: Mapping[str, Array], relation: str
) -> Array:
    """What a relation such as `A.pump-plant` or `M.power-resis` is off by, m3/s."""
    module, _, pair = relation.partition(".")
    first, second = pair.split("-")
    if module in scene.rig.pumps:
        return _flow(scene, terms, given, module, first) - _flow(
            scene, terms, given, module, second
        )
    feeding = [m for m in scene.rig.pumps if module in scene.rig.path(m)]
    flows = [_flow(scene, terms, given, m, first) for m in feeding]
    return np.asarray(np.sum(flows, axis=0) - _flow(scene, terms, given, module, second))


def _flow(
    scene: Scene, terms: tuple[Change, ...], given: Mapping[str, Array], module: str, way: str
) -> Array:
    """Net flow of a module as one observer tells it, by the true laws, m3/s."""
    rig = scene.rig
    if way == "flow":
        return given[f"{module}.Q"]
    if way in ("plant", "resis"):
        rest = sum((given[f"{m}.dp"] for m in rig.path(module)), np.zeros_like(scene.time))
        loss = given[f"{module}.dp"] - (rest if way == "plant" else 0.0)
        return _through(scene, terms, module, loss)
    pressure = given[f"{module}.dp"]
    guess = scene.plain.get(f"{module}.Q", np.zeros_like(pressure))
    flow, state = delivered(rig, module, scene.values, given, terms, pressure, guess)
    if way == "power":
        kind, p = rig.kind(module), of_module(scene.values, module)
        inner = flow + total(terms, "slip", module, state)
        law = kind.power(p, state.speed, pressure, inner) if not kind.rising else state.power
        flow = flow * given[f"{module}.P_el"] / (law + total(terms, "power", module, state))
    return np.asarray(flow * (1.0 - leak(terms, module, flow)))


def _through(scene: Scene, terms: tuple[Change, ...], module: str, loss: Array) -> Array:
    """Flow that loses so much in a line or mixer."""
    friction = scene.values[f"{module}.k2"]
    flow = np.sqrt(np.maximum(loss, 1.0) / friction)
    for _ in range(ROUNDS):
        step = 1e-6 * flow
        now = line_loss(scene.values, module, terms, flow)
        slope = (line_loss(scene.values, module, terms, flow + step) - now) / step
        flow = np.maximum(flow - (now - loss) / slope, 0.2 * flow)
    return flow
