"""A stationary plant: what stands there, what its sensors are, and its operating points.

Unknown is the flow of each pump: it must be what the pump delivers against the pressure that the
flows cause. Newton's method with differences, all samples at once. Where the pressure is set by
the load (oil sets), nothing is unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..sensors import DOSING_SIGNALS, MIXER_SIGNALS, Sensor
from ..units import BAR, LITRE_PER_HOUR, ZERO_CELSIUS, Array
from .pumps import LM, MIXER, PUMPS, Numbers, PumpKind, Values
from .term import Change, State, total

ITERATIONS = 60
TOLERANCE = 1e-11
STEP = 1e-7

START = 400.0 * LITRE_PER_HOUR
"""Flow from which the root search starts."""

HEAD_SCALE = 200.0 * LITRE_PER_HOUR / BAR
"""Flow that a pressure off the curve counts as."""

LOAD_SIGNALS = {
    "dp": Sensor("bar", BAR, bound=0.25, step=0.01),
    "P_el": Sensor("W", 1.0, bound=0.002, step=1.0, relative=True),
    "T": Sensor("degC", 1.0, bound=0.3, step=0.1, offset=ZERO_CELSIUS),
    "Q": Sensor("l/min", LM, bound=0.005, step=0.001, relative=True),
}
"""Of an oil set; bounds as the sensor classes state them."""


class Stalled(ValueError):
    """A pump cannot overcome its back-pressure, or no operating point was found."""


@dataclass(frozen=True)
class Rig:
    """What is on the plant's drawing.

    Attributes
    ----------
    pumps : kind of each pump module
    mixers : size of each mixer, as multiple of the friction of the smallest
    downstream : the mixer next downstream of each module and mixer, None for an open end
    """

    name: str
    pumps: Mapping[str, str]
    mixers: Mapping[str, float]
    downstream: Mapping[str, str | None]

    def kind(self, module: str) -> PumpKind:
        """Kind of a pump module."""
        return PUMPS[self.pumps[module]]

    @property
    def by_load(self) -> bool:
        """Is the pressure set by the load, and the flow metered?"""
        return "oil-set" in self.pumps.values()

    @cached_property
    def feeds(self) -> Array:
        """1 where a mixer lies downstream of a pump, else 0; shape (pumps, mixers)."""
        rows = [[mixer in self.path(name) for mixer in self.mixers] for name in self.pumps]
        return np.array(rows, dtype=np.float64).reshape(len(self.pumps), len(self.mixers))

    def path(self, name: str) -> list[str]:
        """Mixers downstream of a module, nearest first."""
        found, at = [], self.downstream[name]
        while at is not None:
            found.append(at)
            at = self.downstream[at]
        return found

    @cached_property
    def numbers(self) -> Numbers:
        """All parameters with their uncertainties, SI, by `module.parameter`."""
        found = {
            f"{m}.{p}": number for m in self.pumps for p, number in self.kind(m).numbers.items()
        }
        for mixer, size in self.mixers.items():
            value, u = MIXER["k2"]
            found[f"{mixer}.k0"] = MIXER["k0"]
            found[f"{mixer}.k2"] = (value * size, u if size == 1.0 else 0.005 * value * size)
        return found

    @cached_property
    def sensors(self) -> Mapping[str, Sensor]:
        """All sensors by `module.signal`, in the order of the columns."""
        signals = LOAD_SIGNALS if self.by_load else DOSING_SIGNALS
        found = {}
        for module in self.pumps:
            for name, sensor in signals.items():
                bound = sensor.bound / (self.kind(module).gear if name == "n" else 1.0)
                found[f"{module}.{name}"] = Sensor(
                    sensor.unit, sensor.scale, bound, sensor.step, sensor.offset, sensor.relative
                )
        return found | {f"{mixer}.dp": MIXER_SIGNALS["dp"] for mixer in self.mixers}

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Signals that are set, not caused."""
        set_ = "dp" if self.by_load else "n"
        return tuple(f"{module}.{set_}" for module in self.pumps)

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Signals whose values the plant's physics causes; a flow meter that is not used for
        diagnosis is left out."""
        caused = ("P_el", "Q") if self.by_load else ("dp", "P_el")
        names = [f"{module}.{name}" for module in self.pumps for name in caused]
        return (*names, *(f"{mixer}.dp" for mixer in self.mixers))


def solve(
    rig: Rig,
    values: Values,
    given: Mapping[str, Array],
    terms: Sequence[Change] = (),
    start: Mapping[str, Array] | None = None,
) -> dict[str, Array]:
    """What truly happens, by signal, SI, shape (n,): outputs, and the net flow `module.Q`.

    Parameters
    ----------
    given : true inputs, by signal
    start : net flows `module.Q` to begin with

    Raises
    ------
    Stalled
        No operating point with forward flow in every pump.
    """
    if rig.by_load:
        return _by_load(rig, values, given, terms)
    modules = list(rig.pumps)
    samples = given[rig.inputs[0]].size
    flow = np.full((samples, len(modules)), START)
    if start is not None:
        flow = np.stack([start[f"{m}.Q"] for m in modules], 1)
    scale = np.abs(flow).max(axis=0)
    for _ in range(ITERATIONS):
        off = _imbalance(rig, values, given, terms, flow)
        jacobian = np.empty((*flow.shape, len(modules)))
        for k in range(len(modules)):
            moved = flow.copy()
            moved[:, k] += STEP * scale[k]
            changed = _imbalance(rig, values, given, terms, moved)
            jacobian[:, :, k] = (changed - off) / (STEP * scale[k])
        try:
            step = np.linalg.solve(jacobian, off[:, :, None])[:, :, 0]
        except np.linalg.LinAlgError as problem:
            raise Stalled("no operating point") from problem
        # A pump's flow is never more than halved or doubled at once: curves end there.
        flow = np.clip(flow - step, 0.5 * flow, 2.0 * flow)
        if not np.all(np.isfinite(flow)):
            raise Stalled("no operating point")
        if np.max(np.abs(step) / scale) < TOLERANCE:
            break
    else:
        if np.max(np.abs(step) / scale) > 1e-7:
            raise Stalled("no operating point")
    if np.any(flow < 0.02 * scale):
        raise Stalled("a pump cannot overcome its back-pressure")
    return _results(rig, values, given, terms, flow)


def _state(
    rig: Rig,
    module: str,
    values: Values,
    given: Mapping[str, Array],
    terms: Sequence[Change],
    pressure: Array,
    flow: Array,
) -> State:
    """Operating point of a pump against a pressure."""
    kind, p = rig.kind(module), of_module(values, module)
    zero = np.zeros_like(pressure)
    speed = given.get(f"{module}.n", np.ones_like(pressure))
    plain = State(speed, flow, pressure, zero, zero, zero)
    pressure = pressure + total(terms, "head", module, plain)
    speed = speed * (1.0 - total(terms, "shaft", module, plain))
    free, slip = kind.flow(p, speed, pressure)
    power = kind.power(p, speed, pressure, free - slip)
    idle = kind.power(p, speed, zero, free) if kind.rising else power
    return State(speed, flow, pressure, power, idle, slip)


def delivered(
    rig: Rig,
    module: str,
    values: Values,
    given: Mapping[str, Array],
    terms: Sequence[Change],
    pressure: Array,
    flow: Array,
) -> tuple[Array, State]:
    """Flow of a pump before a leak, m3/s, and its operating point."""
    state = _state(rig, module, values, given, terms, pressure, flow)
    free, slip = rig.kind(module).flow(of_module(values, module), state.speed, state.pressure)
    state = replace(state, pressure=pressure, slip=slip)
    kept = 1.0 - total(terms, "gain", module, state)
    return (free - slip) * kept - total(terms, "slip", module, state), state


def _off(
    rig: Rig,
    module: str,
    values: Values,
    given: Mapping[str, Array],
    terms: Sequence[Change],
    pressure: Array,
    flow: Array,
) -> Array:
    """What vanishes at the operating point of a pump, as a flow, m3/s."""
    given_flow, state = delivered(rig, module, values, given, terms, pressure, flow)
    curve = rig.kind(module).head
    if curve is None:
        return flow - given_flow
    inner = flow + total(terms, "slip", module, state)
    inner = inner / (1.0 - total(terms, "gain", module, state))
    wanted = pressure + total(terms, "head", module, state)
    steep = HEAD_SCALE
    return np.asarray((wanted - curve(of_module(values, module), state.speed, inner)) * steep)


def _pressures(
    rig: Rig,
    values: Values,
    terms: Sequence[Change],
    net: Array,
) -> tuple[Array, Array]:
    """Pressure across each pump and each mixer by the net flows, Pa; shapes (n, ...)."""
    through = net @ rig.feeds
    mixers = [line_loss(values, m, terms, through[:, k]) for k, m in enumerate(rig.mixers)]
    lines = [line_loss(values, m, terms, net[:, k]) for k, m in enumerate(rig.pumps)]
    mixer = np.stack(mixers, 1) if mixers else np.zeros((len(net), 0))
    return np.stack(lines, 1) + mixer @ rig.feeds.T, mixer


def line_loss(values: Values, name: str, terms: Sequence[Change], flow: Array) -> Array:
    """Loss of a line or mixer, Pa."""
    zero = np.zeros_like(flow)
    state = State(zero, flow, zero, zero, zero, zero)
    friction = values[f"{name}.k2"] * (1.0 + total(terms, "friction", name, state))
    loss = values[f"{name}.k0"] + friction * flow * np.abs(flow)
    return np.asarray(loss + total(terms, "loss", name, state))


def leak(terms: Sequence[Change], module: str, flow: Array) -> Array | float:
    zero = np.zeros_like(flow)
    return total(terms, "leak", module, State(zero, flow, zero, zero, zero, zero))


def _net(rig: Rig, terms: Sequence[Change], flow: Array) -> Array:
    parts = [flow[:, k] * (1.0 - leak(terms, m, flow[:, k])) for k, m in enumerate(rig.pumps)]
    return np.stack(parts, 1)


def _imbalance(
    rig: Rig,
    values: Values,
    given: Mapping[str, Array],
    terms: Sequence[Change],
    flow: Array,
) -> Array:
    """What vanishes where every pump works against what the flows cause, m3/s."""
    net = _net(rig, terms, flow)
    pressure, _ = _pressures(rig, values, terms, net)
    found = []
    for k, m in enumerate(rig.pumps):
        found.append(_off(rig, m, values, given, terms, pressure[:, k], flow[:, k]))
    return np.stack(found, 1)


def _results(
    rig: Rig,
    values: Values,
    given: Mapping[str, Array],
    terms: Sequence[Change],
    flow: Array,
) -> dict[str, Array]:
    net = _net(rig, terms, flow)
    pressure, mixer = _pressures(rig, values, terms, net)
    found = {}
    for k, m in enumerate(rig.pumps):
        _, state = delivered(rig, m, values, given, terms, pressure[:, k], flow[:, k])
        found[f"{m}.dp"] = pressure[:, k]
        found[f"{m}.P_el"] = state.power + total(terms, "power", m, state)
        found[f"{m}.Q"] = net[:, k]
    return found | {f"{m}.dp": mixer[:, k] for k, m in enumerate(rig.mixers)}


def _by_load(
    rig: Rig, values: Values, given: Mapping[str, Array], terms: Sequence[Change]
) -> dict[str, Array]:
    """Oil sets: the load sets the pressure, the flow follows."""
    found = {}
    for m in rig.pumps:
        pressure = given[f"{m}.dp"]
        flow, state = delivered(rig, m, values, given, terms, pressure, np.zeros_like(pressure))
        found[f"{m}.Q"] = flow * (1.0 - leak(terms, m, flow))
        found[f"{m}.P_el"] = state.power + total(terms, "power", m, state)
    return found


def of_module(values: Values, module: str) -> dict[str, float]:
    """Parameters of one module by their own names."""
    lead = f"{module}."
    return {name.removeprefix(lead): v for name, v in values.items() if name.startswith(lead)}
