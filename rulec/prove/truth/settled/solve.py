"""Operating points of a stationary plant, for all samples at once, and terms beyond its plain laws.

Unknown is the flow of each pump, which must be its delivery at the pressure that the flows cause.
Newton's method with finite differences. If the load sets the pressure (oil sets), nothing is
unknown.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
Shown = Literal["reading", "column"]
"""What a term changes: `slip` lost flow of the pump, m3/s; `gain` lost share of the delivered flow;
`head` lost pressure of a centrifugal pump, Pa; `loss` of a line or mixer, Pa; `power` at the motor,
W; `shaft` lost share of the shown speed; `leak` share of the pump's flow that returns; `friction`
added share of the friction of a line or mixer; `passage` flow of a pump that is none for a while,
m3/s, NaN while its law holds; `reading` of a sensor; `column` in the file."""


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


def at(flow: Array, pressure: Array | float = 0.0, speed: Array | float = 0.0) -> State:
    """Return the operating point of a line, or of a pump before its laws."""
    zero = np.zeros_like(flow)
    return State(zero + speed, flow, zero + pressure, zero, zero, zero)


@dataclass(frozen=True)
class Term:
    """What is added to the plain laws, or what is shown instead of the truth.

    Attributes
    ----------
    place : a module or mixer; of a reading or column a signal such as `A.dp`
    law : by the operating point; a reading by the true value, SI; a column by the correct columns
        with noise, by signal, in which units play no part; shape (n,)
    """

    kind: Kind | Shown
    place: str
    law: Callable[[Any], Array]


def written_by(terms: Sequence[Term], columns: Mapping[str, Array]) -> dict[str, Array]:
    """Return the columns in the file by place."""
    return {**columns, **{t.place: t.law(columns) for t in terms if t.kind == "column"}}


def shown_by(terms: Sequence[Term], place: str, value: Array) -> Array:
    """Return the reading of a sensor with all its errors beyond its class."""
    for term in terms:
        if (term.kind, term.place) == ("reading", place):
            value = term.law(value)
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
    terms: Sequence[Term] = ()

    def parameters(self, module: str) -> dict[str, Any]:
        """Return the parameters of a module by their own names, and a temperature input."""
        lead = f"{module}."
        own = {n.removeprefix(lead): v for n, v in self.values.items() if n.startswith(lead)}
        temperature = self.given.get(f"{lead}T")
        return own if temperature is None else {**own, "T": temperature}

    def laws(self, kind: Kind, module: str, state: State) -> list[Array]:
        """Return the values of all terms of a kind in a module."""
        return [t.law(state) for t in self.terms if (t.kind, t.place) == (kind, module)]

    def total(self, kind: Kind, module: str, state: State) -> Array | float:
        """Return the sum of all terms of a kind in a module."""
        found = self.laws(kind, module, state)
        return np.sum(found, axis=0) if found else 0.0

    def delivered(self, module: str, pressure: Array, flow: Array) -> tuple[Array, State]:
        """Return the flow of a pump before a leak, m3/s, and its operating point."""
        kind, p = self.rig.kind(module), self.parameters(module)
        shown = self.given.get(f"{module}.{'x' if self.rig.by_travel else 'n'}", 1.0)
        plain = at(flow, pressure, shown)
        inner = pressure + self.total("head", module, plain)
        speed = plain.speed * (1.0 - self.total("shaft", module, plain))
        free, slip = kind.flow(p, speed, inner)
        power = kind.power(p, speed, inner, free - slip)
        idle = kind.power(p, speed, np.zeros_like(flow), free) if kind.rising else power
        state = State(speed, flow, pressure, power, idle, slip)
        passed = 1.0 - self.total("gain", module, state)
        return (free - slip) * passed - self.total("slip", module, state), state

    def line_loss(self, name: str, flow: Array, behind: Array | float = 0.0) -> Array:
        """Return the loss of a line or mixer, Pa, with a pressure `behind` it."""
        state = at(flow, behind)
        friction = self.values[f"{name}.k2"] * (1.0 + self.total("friction", name, state))
        loss = self.values[f"{name}.k0"] + friction * flow * np.abs(flow)
        return np.asarray(loss + self.total("loss", name, state))

    def net(self, module: str, flow: Array) -> Array:
        """Return the part of a pump's flow that leaves its module, after a leak, m3/s."""
        return np.asarray(flow * (1.0 - self.total("leak", module, at(flow))))

    def power(self, module: str, state: State) -> Array:
        """Return the power at the motor, W."""
        return np.asarray(state.power + self.total("power", module, state))


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
        off, _ = _operated(plant, flow)
        jacobian = np.empty((*flow.shape, len(modules)))
        for k in range(len(modules)):
            moved = flow.copy()
            moved[:, k] += STEP * scale[k]
            jacobian[:, :, k] = (_operated(plant, moved)[0] - off) / (STEP * scale[k])
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
    return _operated(plant, flow)[1]


def _operated(plant: Operated, flow: Array) -> tuple[Array, dict[str, Array]]:
    """Errors that vanish at the operating point, m3/s, and the signals there, by the flows of the
    pumps; shapes (n, pumps)."""
    rig, found, errors = plant.rig, dict[str, Array](), []
    net = np.stack([plant.net(m, flow[:, k]) for k, m in enumerate(rig.pumps)], 1)
    through = net @ rig.feeds
    losses = {m: plant.line_loss(m, through[:, k]) for k, m in enumerate(rig.mixers)}
    mixer = np.stack([*losses.values()], 1) if losses else np.zeros((len(net), 0))
    behind = mixer @ rig.feeds.T
    for k, m in enumerate(rig.pumps):
        pressure = plant.line_loss(m, net[:, k], behind[:, k]) + behind[:, k]
        given, state = plant.delivered(m, pressure, flow[:, k])
        off, kind = flow[:, k] - given, rig.kind(m)
        if kind.by_head:
            inner = flow[:, k] + plant.total("slip", m, state)
            inner = inner / (1.0 - plant.total("gain", m, state))
            wanted = pressure + plant.total("head", m, state)
            off = (wanted - kind.head(plant.parameters(m), state.speed, inner)) * HEAD_SCALE
        for passing in plant.laws("passage", m, state):
            off = np.where(np.isnan(passing), off, flow[:, k] - passing)
        errors.append(off)
        found |= {f"{m}.dp": pressure, f"{m}.P_el": plant.power(m, state), f"{m}.Q": net[:, k]}
    return np.stack(errors, 1), found | {f"{m}.dp": loss for m, loss in losses.items()}


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
    found: dict[str, Array] = {}
    for m in plant.rig.pumps:
        kind, p = plant.rig.kind(m), plant.parameters(m)
        shown, net = plant.given[f"{m}.n"], plant.given[f"{m}.Q"]
        flow = net / (1.0 - plant.total("leak", m, at(net)))
        pressure = kind.head(p, shown, flow)
        for _ in range(ITERATIONS):
            plain = at(flow, pressure, shown)
            speed = shown * (1.0 - plant.total("shaft", m, plain))
            inner = (flow + plant.total("slip", m, plain)) / (1.0 - plant.total("gain", m, plain))
            last, pressure = pressure, kind.head(p, speed, inner) - plant.total("head", m, plain)
            if np.max(np.abs(pressure - last)) < TOLERANCE * BAR:
                break
        else:
            raise Stalled("no operating point")
        power = kind.power(p, speed, pressure, inner)
        state = State(speed, flow, pressure, power, power, np.zeros_like(net))
        found |= {f"{m}.dp": pressure, f"{m}.P_el": plant.power(m, state), f"{m}.Q": net}
        if np.any(pressure < LEAST_HEAD):
            raise Stalled("a pump cannot overcome its back-pressure")
    return found
