"""A characteristic learnt from ordinary operation: a definition of a module as a monotone curve.

At each settled point, an observer and the true flow determine the value of the definition. A
piecewise linear curve with knots at quantiles is fitted to these points; it rises or falls
throughout, whichever fits better. Its band covers the scatter of the points and the errors of the
sensors and of the other parameters.

Source: monotone regression by non-negative increments (Ramsay 1988, with piecewise lines).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import sympy
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.robust_statistics import autocorrelation_time, spread_about
from scipy.optimize import least_squares

from rulec.algebra.graph import Graph
from rulec.algebra.recipe import lower
from rulec.algebra.tangent import run_with_slopes
from rulec.calibration.calibrate import local_readings, settled_points
from rulec.calibration.fit import CalibrationRefused
from rulec.calibration.limits import COVERAGE, NO_VALUE, ROBUST_WIDTH, SOLVED
from rulec.calibration.true_flow import Local, TrueFlow, true_flows
from rulec.curves.limits import GAP, KNOT_GAP, LEARNT_FAR, LEARNT_KNOTS
from rulec.knowledge.module_type import ModuleType, Signal
from rulec.knowledge.plant import Module
from rulec.limits import FAR_POINT, POINTS_PER_PARAMETER
from rulec.passes.differentiate import GATHERED, TypeModel, observers_over, written_out
from rulec.passes.types import Compilation


@dataclass(frozen=True, kw_only=True)
class Learnt:
    """A curve over `over`, all SI: knots, values and standard uncertainties, each shape (k,).

    95 % of the points deviate by less than `accuracy`, a share. `gaps` are spans of `over` without
    points, between knots or up to the ends of the sensor's range.
    """

    module: Module
    name: str
    over: str
    knots: Array
    values: Array
    u: Array
    accuracy: float
    points: int
    set_aside: int
    gaps: tuple[tuple[float, float], ...]
    sensors: tuple[str, ...]


def learn(
    models: Compilation, recording: Recording, name: str, what: str, over: str | None
) -> Learnt:
    """Learn ``MODULE.DEFINITION`` over a signal or a definition.

    Raises `CalibrationRefused` if it does not exist, depends on more than `over`, nothing has
    settled, no true flow is known, or its driver did not vary.
    """
    module, definition = _named(models, what)
    kind = module.type.settled()
    over = _driver(kind, what, definition, over)
    settled = settled_points(models, recording, name)
    every = models.plant.modules.values()
    local = {m.name: local_readings(models, settled.points, m) for m in every}
    flows = true_flows(models, local)
    if module.name not in flows:
        raise CalibrationRefused(f"{what}: the recording has no true flow through {module.name}")
    own, true = local[module.name], flows[module.name]
    samples = samples_of(models.types[module.type.key], kind, module, definition, over, own, true)
    usable = np.flatnonzero(
        np.isfinite(samples.driver) & np.isfinite(samples.flow) & np.isfinite(samples.before)
        & np.isfinite(samples.off(samples.before))
    )  # fmt: skip
    if len(usable) < 2 * POINTS_PER_PARAMETER:
        raise CalibrationRefused(
            f"{what}: only {len(usable)} settled points with all readings and {true.name}; "
            f"{2 * POINTS_PER_PARAMETER} are needed for a curve"
        )
    chosen = samples.at(usable)
    # As in a calibration, what varies within the bounds of its sensor is one value.
    bounds = (
        2.0 * COVERAGE * np.max(own.systematic[over][usable]) if over in own.systematic else 0.0
    )
    if not np.ptp(chosen.driver) > bounds:
        why = "as far as its sensor can tell; record operation in which it varies"
        raise CalibrationRefused(f"{what}: {over} stood, {why}")
    if not np.any(chosen.flow):
        raise CalibrationRefused(f"{what}: nothing flows through {module.name} while it is settled")
    knots, values, bulk = _fitted(chosen)
    final, rows = chosen.at(bulk), usable[bulk]
    u_of: dict[str, Array | float] = {n: p.u for n, p in module.parameters.items()}
    u_of |= {n: u[rows] for n, u in own.systematic.items()}
    errors = {n: e[rows] for n, e in true.errors.items()}
    u, accuracy = _band(final, values, knots, u_of, errors)
    return Learnt(
        module=module,
        name=definition,
        over=over,
        knots=knots,
        values=values,
        u=u,
        accuracy=accuracy,
        points=len(bulk),
        set_aside=len(usable) - len(bulk),
        gaps=tuple(_gaps(final.driver, kind.signals.get(over))),
        sensors=settled.sensors,
    )


def _named(models: Compilation, what: str) -> tuple[Module, str]:
    name, _, definition = what.partition(".")
    module = models.plant.modules.get(name)
    if module is None:
        hint = did_you_mean(name, models.plant.modules)
        raise CalibrationRefused(f"--learn {what[:80]}: there is no module '{name[:40]}'; {hint}")
    if definition not in module.type.definitions:
        known = ", ".join(module.type.definitions) or "none"
        raise CalibrationRefused(
            f"--learn {what[:80]}: {module.type.name} has no definition '{definition[:40]}'; it "
            f"has {known}. What is to be learnt needs a name of its own in the module type"
        )
    return module, definition


def _driver(kind: ModuleType, what: str, definition: str, over: str | None) -> str:
    """What the curve is a function of; refused if it does not determine the definition."""
    names = kind.names_through(kind.definitions[definition].expression)
    read = sorted(names & kind.signals.keys())
    if over is None:
        inputs = [name for name in read if kind.signals[name].is_input] or read
        if len(inputs) != 1:
            shown = ", ".join(inputs) or "no signal"
            raise CalibrationRefused(f"{what} reads {shown}; name what it follows with --over")
        over = inputs[0]
    if over not in kind.signals and over not in kind.definitions:
        hint = did_you_mean(over, [*kind.signals, *kind.definitions])
        raise CalibrationRefused(f"--over {over[:40]}: {kind.name} has no such signal; {hint}")
    by = {over} if over in kind.signals else kind.names_through(kind.definitions[over].expression)
    if more := [name for name in read if name not in by]:
        raise CalibrationRefused(
            f"{what} follows {', '.join(more)}, too: a curve over {over} cannot say that. Split "
            f"the definition in the module type, so that one part follows {over} alone"
        )
    if over in kind.definitions and definition in kind.names_through(
        kind.definitions[over].expression
    ):
        raise CalibrationRefused(f"--over {over}: it stands on {definition} itself")
    return over


def _knots(driver: Array) -> Array:
    """Quantiles of the driver, at least a share of its span apart."""
    count = int(np.clip(len(driver) // POINTS_PER_PARAMETER, 2, LEARNT_KNOTS))
    found = [float(np.min(driver))]
    least = KNOT_GAP * float(np.ptp(driver))
    for at in np.quantile(driver, np.linspace(0.0, 1.0, count))[1:]:
        if at - found[-1] > least:
            found.append(float(at))
    return np.array(found)


def _between(driver: Array, knots: Array) -> Array:
    """Weights of the knots at each point for linear interpolation, shape (n, k)."""
    rows: Array = np.array([np.interp(driver, knots, unit) for unit in np.eye(len(knots))])
    return rows.T


def _fitted(samples: Samples) -> tuple[Array, Array, np.ndarray]:
    """Knots, values there, and rows kept: far points hardly count at first, then they are left
    out."""
    knots = _knots(samples.driver)
    off = samples.off(_between(samples.driver, knots) @ _monotone(samples, knots, "soft_l1"))
    spread = spread_about(off, float(np.median(off)))
    near = np.maximum(FAR_POINT * spread, LEARNT_FAR * np.abs(samples.flow))
    rows = np.flatnonzero(np.abs(off) <= near)
    bulk = samples.at(rows)
    knots = _knots(bulk.driver)
    return knots, _monotone(bulk, knots, "linear"), rows


def _monotone(samples: Samples, knots: Array, loss: str) -> Array:
    """Values that rise or fall from knot to knot, whichever leaves smaller errors: the lowest one
    and increments, as least squares with the `loss` of scipy find them."""
    weights, count = _between(samples.driver, knots), len(knots)
    largest = float(np.max(np.abs(samples.flow)))
    size = max(float(np.max(np.abs(samples.before))), np.finfo(float).tiny)
    begin, low = np.full(count, 1.0 / count), np.zeros(count)
    begin[0] = float(np.median(samples.before)) / size
    low[0] = 1e-3 * begin[0] if np.all(samples.before > 0.0) else -np.inf
    rising = size * np.tril(np.ones((count, count)))
    ways = []
    for sums in (rising, rising[::-1]):

        def off(parts: Array, sums: Array = sums) -> Array:
            share = samples.off(weights @ (sums @ parts)) / largest
            return np.where(np.isfinite(share), share, NO_VALUE)

        found = least_squares(
            off,
            begin,
            bounds=(low, np.inf),
            loss=loss,
            f_scale=ROBUST_WIDTH,
            x_scale="jac",
            xtol=SOLVED,
            ftol=SOLVED,
        )
        ways.append((float(found.cost), sums @ found.x))
    return np.asarray(min(ways, key=lambda way: way[0])[1])


def _band(
    samples: Samples,
    values: Array,
    knots: Array,
    u_of: Mapping[str, Array | float],
    errors: Mapping[str, Array],
) -> tuple[Array, float]:
    """Standard uncertainties of the values, by the scatter of the points, those of readings and
    parameters (`u_of`), and `errors` of the true flow; and the share by which 95 % of the points
    deviate at most."""
    weights = _between(samples.driver, knots)
    curve = weights @ values
    at = {**samples.inputs, CURVE: curve}
    out, slopes = run_with_slopes(samples.plan, at, [CURVE, *u_of])
    off, by = out["Q"] - samples.flow, slopes["Q"]
    inverse = np.linalg.pinv(by[CURVE][..., None] * weights)
    variance = float(np.sum(off**2)) / max(len(off) - len(knots), 1)
    variance *= autocorrelation_time(off, np.ones(len(off), dtype=bool))
    total = variance * np.sum(inverse**2, axis=1)
    for name in dict.fromkeys([*u_of, *errors]):
        moved = by.get(name, 0.0) * u_of.get(name, 0.0) - errors.get(name, np.zeros(len(off)))
        total += (inverse @ np.where(np.isfinite(moved), moved, 0.0)) ** 2
    share = np.abs(off / by[CURVE]) / np.abs(curve)
    return np.sqrt(total), float(np.nanquantile(share, 0.95))


def _gaps(driver: Array, signal: Signal | None) -> Sequence[tuple[float, float]]:
    """Spans without points that are wider than a share of the sensor's range."""
    points, low, high = np.unique(driver), np.inf, -np.inf
    if signal is not None and signal.lowest is not None and signal.highest is not None:
        low, high = signal.lowest, signal.highest
    ends = np.concatenate([[min(low, points[0])], points, [max(high, points[-1])]])
    wide = np.flatnonzero(np.diff(ends) > GAP * (ends[-1] - ends[0]))
    return [(float(ends[i]), float(ends[i + 1])) for i in wide]


CURVE, DRIVER, BEFORE = "curve", "driver", "before"
"""An input and two outputs of the plan of a point."""


@dataclass(frozen=True)
class Samples:
    """At each point the `driver`, the definition `before` learning, the true `flow` (m3/s), and a
    plan that gives the flow of an observer as a function of `CURVE`."""

    plan: Plan
    inputs: Mapping[str, Array | float]
    driver: Array
    before: Array
    flow: Array

    def at(self, rows: np.ndarray) -> Samples:
        """The points of these rows."""
        inputs = {n: v[rows] if isinstance(v, np.ndarray) else v for n, v in self.inputs.items()}
        return Samples(self.plan, inputs, self.driver[rows], self.before[rows], self.flow[rows])

    def off(self, curve: Array) -> Array:
        """The error of the law where the definition has the values `curve`, shape (n,), m3/s."""
        return np.asarray(self.plan.run({**self.inputs, CURVE: curve})["Q"] - self.flow)


def samples_of(
    model: TypeModel,
    kind: ModuleType,
    module: Module,
    definition: str,
    over: str,
    own: Local,
    true: TrueFlow,
) -> Samples:
    """Samples by the first observer that uses the definition and whose readings are recorded."""
    symbol, observers = observers_over(kind, definition, model.symbols, model.observers)
    reference = {o.name for o in kind.observers.values() if o.is_reference}
    found = [e for n, e in observers.items() if symbol in e.free_symbols and n not in reference]
    lacking = [[n for n in _readings(e, model) if n not in own.values] for e in found]
    whole = [e for e, lacks in zip(found, lacking, strict=True) if not lacks]
    if not whole:
        why = f"the recording lacks {', '.join(lacking[0])}" if found else "no observer uses it"
        raise CalibrationRefused(f"{module.name}.{definition}: {why}")
    table = written_out(kind, model.symbols)
    graph = Graph((*model.symbols, CURVE))
    nodes = {s: graph.input(n) for n, s in model.symbols.items()} | {symbol: graph.input(CURVE)}
    outputs = {"Q": whole[0], DRIVER: table[over], BEFORE: table[definition]}
    for name, expression in outputs.items():
        graph.outputs[name] = lower(graph, expression, nodes)
    plan = graph.plan()
    inputs: dict[str, Array | float] = {n: p.value for n, p in module.parameters.items()}
    inputs |= own.values
    out = plan.run(inputs)
    driver, before = (np.broadcast_to(out[n], true.values.shape) for n in (DRIVER, BEFORE))
    return Samples(plan, inputs, driver, before, true.values)


def _readings(expression: sympy.Expr, model: TypeModel) -> list[str]:
    free = expression.free_symbols
    return [
        n for n, s in model.symbols.items()
        if s in free and (n in model.type.signals or n.startswith(GATHERED))
    ]  # fmt: skip
