"""Operating points of a stationary plant, for all samples at once, and terms beyond its plain laws.

Unknown is the flow of each pump, which must be its delivery at the pressure that the flows cause.
Newton's method with finite differences. If the load sets the pressure (oil sets), nothing is
unknown.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, Array
from .rig import Rig, Values

ITERATIONS = 60
TOLERANCE = 1e-11
STEP = 1e-7

START = 400.0 * LITRE_PER_HOUR
"""Start of the root search."""

LEAST_HEAD = 0.06 * BAR
"""Least head of a metered pump; below, a ratio of heads is meaningless."""

HEAD_SCALE = 200.0 * LITRE_PER_HOUR / BAR
"""Converts an error of the head to one of the flow."""


class Stalled(ValueError):
    """A pump cannot overcome its back-pressure, or there is no operating point."""


Kind = Literal["slip", "gain", "head", "loss", "power", "shaft", "leak", "friction", "passage"]
"""Where a term acts: `slip` lost flow of the pump, m3/s; `gain` lost share of the delivered flow;
`head` lost pressure of a centrifugal pump, Pa; `loss` of a line or mixer, Pa; `power` at the motor,
W; `shaft` lost share of the shown speed; `leak` share of the pump's flow that returns; `friction`
added share of the friction of a line or mixer; `passage` flow of a pump that is none for a while,
m3/s, NaN while its law holds."""


@dataclass(frozen=True)
class State:
    """Operating point of one module or mixer; arrays of shape (n,).

    Attributes
    ----------
    speed : of the shaft, rev/s
    flow : net flow, m3/s
    pressure : across the pump, or behind a line, Pa
    power, idle : of the plain law, W, at the pressure and at none
    slip : of the plain law driven by pressure, m3/s
    """

    speed: Array
    flow: Array
    pressure: Array
    power: Array
    idle: Array
    slip: Array


Law = Callable[[State], Array]


@dataclass(frozen=True)
class Term:
    """A law that is added in a module or mixer."""

    kind: Kind
    module: str
    law: Law


@dataclass(frozen=True)
class Reading:
    """The reading of a sensor by its true value, both SI, shape (n,); `place` such as `A.dp`."""

    place: str
    shown: Callable[[Array], Array]


@dataclass(frozen=True)
class Column:
    """The column of `place` in the file by the correct columns, each of shape (n,).

    The columns include noise. Units play no part.
    """

    place: str
    written: Callable[[Mapping[str, Array]], Array]


Change = Term | Reading | Column


def written_by(terms: Sequence[Change], columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return the columns in the file by place."""
    wrong = {t.place: t.written(columns) for t in terms if isinstance(t, Column)}
    return {**columns, **wrong}


def shown_by(terms: Sequence[Change], place: str, value: Array) -> Array:
    """Return the reading of a sensor with all its errors beyond its class."""
    for term in terms:
        if isinstance(term, Reading) and term.place == place:
            value = term.shown(value)
    return value


@dataclass(frozen=True)
class Operated:
    """A plant in operation.

    Attributes
    ----------
    values : true parameters, SI, by `module.parameter`
    given : true inputs, SI, by signal, shape (n,)
    terms : terms beyond the plain laws
    """

    rig: Rig
    values: Values
    given: Mapping[str, Array]
    terms: Sequence[Change] = ()

    def parameters(self, module: str) -> dict[str, Any]:
        """Return the parameters of a module by their own names, and a temperature input."""
        lead = f"{module}."
        own = {n.removeprefix(lead): v for n, v in self.values.items() if n.startswith(lead)}
        temperature = self.given.get(f"{lead}T")
        return own if temperature is None else {**own, "T": temperature}

    def laws(self, kind: Kind, module: str, state: State) -> list[Array]:
        """Return the values of all terms of a kind in a module."""
        own = (
            t for t in self.terms if isinstance(t, Term) and (t.kind, t.module) == (kind, module)
        )
        return [term.law(state) for term in own]

    def total(self, kind: Kind, module: str, state: State) -> Array | float:
        """Return the sum of all terms of a kind in a module."""
        found = self.laws(kind, module, state)
        return np.sum(found, axis=0) if found else 0.0

    def delivered(self, module: str, pressure: Array, flow: Array) -> tuple[Array, State]:
        """Return the flow of a pump before a leak, m3/s, and its operating point."""
        state = self._state(module, pressure, flow)
        free, slip = self.rig.kind(module).flow(
            self.parameters(module), state.speed, state.pressure
        )
        state = replace(state, pressure=pressure, slip=slip)
        kept = 1.0 - self.total("gain", module, state)
        return (free - slip) * kept - self.total("slip", module, state), state

    def line_loss(self, name: str, flow: Array, behind: Array | float = 0.0) -> Array:
        """Return the loss of a line or mixer, Pa, with a pressure `behind` it."""
        state = replace(_of_flow(flow), pressure=behind + np.zeros_like(flow))
        friction = self.values[f"{name}.k2"] * (1.0 + self.total("friction", name, state))
        loss = self.values[f"{name}.k0"] + friction * flow * np.abs(flow)
        return np.asarray(loss + self.total("loss", name, state))

    def net(self, module: str, flow: Array) -> Array:
        """Return the part of a pump's flow that leaves its module, after a leak, m3/s."""
        return np.asarray(flow * (1.0 - self.total("leak", module, _of_flow(flow))))

    def power(self, module: str, state: State) -> Array:
        """Return the power at the motor, W."""
        return np.asarray(state.power + self.total("power", module, state))

    def _state(self, module: str, pressure: Array, flow: Array) -> State:
        """Operating point of a pump at a pressure."""
        kind, p = self.rig.kind(module), self.parameters(module)
        zero = np.zeros_like(pressure)
        setting = "x" if self.rig.by_travel else "n"
        speed = self.given.get(f"{module}.{setting}", np.ones_like(pressure))
        plain = State(speed, flow, pressure, zero, zero, zero)
        pressure = pressure + self.total("head", module, plain)
        speed = speed * (1.0 - self.total("shaft", module, plain))
        free, slip = kind.flow(p, speed, pressure)
        power = kind.power(p, speed, pressure, free - slip)
        idle = kind.power(p, speed, zero, free) if kind.rising else power
        return State(speed, flow, pressure, power, idle, slip)


def solve(
    plant: Operated, start: Mapping[str, Array] | None = None, backflow: bool = False
) -> dict[str, Array]:
    """Return the true outputs and net flows `module.Q` by signal, SI, shape (n,).

    `start` has net flows `module.Q` to start from. Raises Stalled if there is no operating point
    with forward flow in every pump; with `backflow` flows may have any sign and size.
    """
    rig = plant.rig
    if rig.by_load:
        return _by_load(plant)
    if rig.by_meter:
        return _by_meter(plant)
    modules = list(rig.pumps)
    samples = plant.given[rig.inputs[0]].size
    flow = np.full((samples, len(modules)), START)
    if start is not None:
        flow = np.stack([start[f"{m}.Q"] for m in modules], 1)
    scale = np.abs(flow).max(axis=0)
    for _ in range(ITERATIONS):
        off = _imbalance(plant, flow)
        jacobian = np.empty((*flow.shape, len(modules)))
        for k in range(len(modules)):
            moved = flow.copy()
            moved[:, k] += STEP * scale[k]
            jacobian[:, :, k] = (_imbalance(plant, moved) - off) / (STEP * scale[k])
        try:
            step = np.linalg.solve(jacobian, off[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError as problem:
            raise Stalled("no operating point") from problem
        # A step at most halves or doubles a flow, because curves end there.
        flow = flow - step if backflow else np.clip(flow - step, 0.5 * flow, 2.0 * flow)
        if not np.all(np.isfinite(flow)):
            raise Stalled("no operating point")
        if np.max(np.abs(step) / scale) < TOLERANCE:
            break
    else:
        if np.max(np.abs(step) / scale) > 1e-7:
            raise Stalled("no operating point")
    if np.any(flow < 0.02 * scale) and not backflow:
        raise Stalled("a pump cannot overcome its back-pressure")
    return _results(plant, flow)


def _of_flow(flow: Array) -> State:
    """The operating point of a line."""
    zero = np.zeros_like(flow)
    return State(zero, flow, zero, zero, zero, zero)


def _imbalance(plant: Operated, flow: Array) -> Array:
    """Errors that vanish at the operating point, m3/s."""
    pressure, _ = _pressures(plant, _net(plant, flow))
    found = [_off(plant, m, pressure[:, k], flow[:, k]) for k, m in enumerate(plant.rig.pumps)]
    return np.stack(found, 1)


def _off(plant: Operated, module: str, pressure: Array, flow: Array) -> Array:
    """Error that vanishes at the operating point of a pump, m3/s."""
    given_flow, state = plant.delivered(module, pressure, flow)
    kind, off = plant.rig.kind(module), flow - given_flow
    if kind.by_head:
        inner = flow + plant.total("slip", module, state)
        inner = inner / (1.0 - plant.total("gain", module, state))
        wanted = pressure + plant.total("head", module, state)
        head = kind.head(plant.parameters(module), state.speed, inner)
        off = (wanted - head) * HEAD_SCALE
    for passing in plant.laws("passage", module, state):
        off = np.where(np.isnan(passing), off, flow - passing)
    return np.asarray(off)


def _net(plant: Operated, flow: Array) -> Array:
    return np.stack([plant.net(m, flow[:, k]) for k, m in enumerate(plant.rig.pumps)], 1)


def _pressures(plant: Operated, net: Array) -> tuple[Array, Array]:
    """Pressure across each pump and each mixer by net flows, Pa; shapes (n, ...)."""
    rig = plant.rig
    through = net @ rig.feeds
    mixers = [plant.line_loss(m, through[:, k]) for k, m in enumerate(rig.mixers)]
    mixer = np.stack(mixers, 1) if mixers else np.zeros((len(net), 0))
    behind = mixer @ rig.feeds.T
    lines = [plant.line_loss(m, net[:, k], behind[:, k]) for k, m in enumerate(rig.pumps)]
    return np.stack(lines, 1) + behind, mixer


def _results(plant: Operated, flow: Array) -> dict[str, Array]:
    net = _net(plant, flow)
    pressure, mixer = _pressures(plant, net)
    found = {}
    for k, m in enumerate(plant.rig.pumps):
        _, state = plant.delivered(m, pressure[:, k], flow[:, k])
        found[f"{m}.dp"] = pressure[:, k]
        found[f"{m}.P_el"] = plant.power(m, state)
        found[f"{m}.Q"] = net[:, k]
    return found | {f"{m}.dp": mixer[:, k] for k, m in enumerate(plant.rig.mixers)}


def _by_load(plant: Operated) -> dict[str, Array]:
    """Oil sets and valves: the pressure is set from outside, the flow follows."""
    found, rig = {}, plant.rig
    for m in rig.pumps:
        pressure = plant.given[f"{m}.dp"]
        flow, state = plant.delivered(m, pressure, np.zeros_like(pressure))
        found[f"{m}.Q"] = plant.net(m, flow)
        if not rig.by_travel:
            found[f"{m}.P_el"] = plant.power(m, state)
    return found


def _by_meter(plant: Operated) -> dict[str, Array]:
    """Metered centrifugal pumps: valves set the flow, the pressure follows.

    Terms beyond the curve may depend on the pressure, so both are found by iteration.
    """
    found = {}
    for m in plant.rig.pumps:
        kind, p = plant.rig.kind(m), plant.parameters(m)
        shown, net = plant.given[f"{m}.n"], plant.given[f"{m}.Q"]
        zero = np.zeros_like(net)
        flow = net / (1.0 - plant.total("leak", m, _of_flow(net)))
        pressure = kind.head(p, shown, flow)
        for _ in range(ITERATIONS):
            plain = State(shown, flow, pressure, zero, zero, zero)
            speed = shown * (1.0 - plant.total("shaft", m, plain))
            inner = (flow + plant.total("slip", m, plain)) / (1.0 - plant.total("gain", m, plain))
            last, pressure = pressure, kind.head(p, speed, inner) - plant.total("head", m, plain)
            if np.max(np.abs(pressure - last)) < TOLERANCE * BAR:
                break
        else:
            raise Stalled("no operating point")
        power = kind.power(p, speed, pressure, inner)
        found[f"{m}.dp"] = pressure
        found[f"{m}.P_el"] = plant.power(m, State(speed, flow, pressure, power, power, zero))
        found[f"{m}.Q"] = net
        if np.any(pressure < LEAST_HEAD):
            raise Stalled("a pump cannot overcome its back-pressure")
    return found
