"""Settled points as means per operating state and block of time.

The inputs alone define a state: points whose inputs agree belong to one. Visits to a state within a
block of time are one mean; visits to different states are never averaged.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.limits import NORMAL_SPREAD
from rulec_runtime.recordings.stationary import Stretches

from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import Flows, System


def states_of(system: System) -> NDArray[np.intp]:
    """Number of the operating state of each point, shape (n,).

    Inputs of one state agree within a share of their range, or within their noise.
    """
    columns = []
    for values, noise in _inputs(system).values():
        tolerance = max(limits.ALIKE_SHARE * float(np.ptp(values)), limits.ALIKE_NOISE * noise)
        columns.append(values / max(tolerance, 1e-300))
    table = np.stack(columns, axis=1) if columns else np.zeros((len(system.data), 1))
    centres = np.empty((0, table.shape[1]))
    counts: list[int] = []
    states = np.zeros(len(table), dtype=np.intp)
    for i, row in enumerate(table):
        far = np.abs(centres - row).max(axis=1, initial=0.0)
        if not len(far) or far.min() > 1.0:
            centres = np.concatenate([centres, row[None, :]])
            counts.append(1)
            states[i] = len(centres) - 1
            continue
        j = states[i] = int(np.argmin(far))
        counts[j] += 1
        centres[j] += (row - centres[j]) / counts[j]
    return states


def likeness(system: System, flows: Flows, module: str) -> Array:
    """Correlation of the errors of form of a module's laws between points, shape (n, n).

    A law and its error of form depend on the set points of the module and on the flow through it,
    here as a function of the plant's inputs: a fault that changes the flow at the same inputs is no
    error of form. Errors are smooth: the covariance is that of Matern with two derivatives.

    Source: Stein 1999, chapter 1.7.
    """
    every = {n: c for n, c in _inputs(system).items() if _spread(c[0]) > limits.FORM_VARIES * c[1]}
    own = [values for name, (values, _) in every.items() if name.partition(".")[0] == module]
    if len(own) < len(every):
        own += _flow_as_set(system, flows, module, [values for values, _ in every.values()])
    columns = [values / (common.FORM_LENGTH * _spread(values)) for values in own]
    table = np.stack(columns, axis=1) if columns else np.zeros((len(system.data), 0))
    square = ((table[:, None, :] - table[None, :, :]) ** 2).sum(axis=-1)
    far = np.sqrt(5.0 * square)
    return np.asarray((1.0 + far + far**2 / 3.0) * np.exp(-far))


def _flow_as_set(system: System, flows: Flows, module: str, inputs: Sequence[Array]) -> list[Array]:
    """The flow through a module as a quadratic function of all inputs, shape (n,), m3/s."""
    own = [i for i, o in enumerate(system.observers) if o.module == module]
    # An estimate may be infinite, as where a pump stands.
    flow = np.where(np.isfinite(flows.values[own]), flows.values[own], np.nan)
    finite = np.asarray(np.isfinite(flow).any(axis=0))
    scaled = [(values - values.mean()) / values.std() for values in inputs]
    terms = [np.ones(len(finite)), *scaled]
    terms += [one * other for i, one in enumerate(scaled) for other in scaled[: i + 1]]
    table = np.stack(terms, axis=1)
    if finite.sum() <= 2 * table.shape[1]:
        table = table[:, : 1 + len(scaled)]
    middle = np.nanmedian(flow[:, finite], axis=0)
    values: Array = table @ np.linalg.lstsq(table[finite], middle, rcond=1e-6)[0]
    return [values] if _spread(values) > 0.0 else []


def _spread(values: Array) -> float:
    """Range of a course without its outermost 5 % at either end."""
    return float(np.subtract(*np.quantile(values, [0.95, 0.05])))


def _inputs(system: System) -> dict[str, tuple[Array, float]]:
    """Values of each recorded input, with the median in gaps, and its noise."""
    data, found = system.data, {}
    for name in (s.id for s in system.ruleset.signals if s.is_input and s.id in data.values):
        values = data.values[name]
        filled = np.nan_to_num(values, nan=float(np.nanmedian(values)))
        found[name] = filled, float(np.nanmedian(data.noise[name]))
    return found


def rows_of_states(system: System, cuts: Array | None = None) -> Rows:
    """Rows whose points are means per operating state and block of time; no mean includes a cut, s,
    at which an effect begins or ends."""
    data = averaged(system, np.zeros(0) if cuts is None else cuts)
    rows = rows_of(replace(system, data=data), Configuration())
    return rows_of(replace(rows.system, data=with_wobble(rows)), Configuration())


def averaged(system: System, cuts: Array) -> Data:
    """The data with one point for each state and block: points of equal state, stretch of time and
    usability are one."""
    data, held = _with_held_inputs(system)
    state, bad = states_of(system), [np.asarray(flags) != 0 for flags in data.points.bad.values()]
    piece = np.searchsorted(cuts, data.time, side="right")
    key = np.column_stack([state, _stretch(data, state), piece, *data.moving.values(), *bad])
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    group = group.ravel()
    count = np.bincount(group).astype(float)
    order = np.argsort(np.bincount(group, data.time) / count)
    first, group, count = first[order], np.argsort(order)[group], count[order]

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(group, values) / count)

    def noise_of_mean(name: str, noise: Array) -> Array:
        # The errors of a held input and of a coarse display are the same in all points of a state.
        if name in held:
            return mean(noise)
        same = data.rounding.get(name, 0.0) ** 2
        return np.asarray(np.sqrt(np.bincount(group, noise**2 - same) / count**2 + same))

    noise = {name: noise_of_mean(name, own) for name, own in data.noise.items()}
    values = {name: mean(v) for name, v in data.points.values.items()}
    systematic = {name: mean(v) for name, v in data.points.systematic.items()}
    u = {name: np.hypot(systematic[name], noise.get(name, 0.0)) for name in values}
    flags = {name: np.asarray(own)[first] for name, own in data.points.bad.items()}
    time = mean(data.time)
    return replace(
        data,
        points=Points(values, u, systematic, flags, data.points.why, time),
        time=time,
        noise=noise,
        block=data.block[first],
        part=data.part[first],
        moving={name: own[first] for name, own in data.moving.items()},
        stretches=Stretches(data.stretches.first[first], data.stretches.last[first]),
        source=data.source[first],
        clock=mean(data.clock),
    )


def _with_held_inputs(system: System) -> tuple[Data, frozenset[str]]:
    """The data with inputs that are held during states at their means, and the names of these.

    Otherwise each sample could have its own true input, and a law that makes a reading independent
    of an input, as an open relief valve does, would explain the noise of the input.
    """
    data, state = system.data, states_of(system)
    new = np.diff(state, prepend=-1) != 0
    new |= np.diff(data.part, prepend=-1) != 0
    new |= np.diff(data.source, prepend=-1) != 0
    visit = np.cumsum(new) - 1
    count = np.bincount(visit).astype(float)[visit]
    values, noises, held = dict(data.points.values), dict(data.noise), set()
    for signal in system.ruleset.signals:
        name = signal.id
        if not signal.is_input or name not in data.noise or not np.isfinite(values[name]).all():
            continue
        usual, noise = (
            (np.bincount(visit, v) / np.bincount(visit))[visit]
            for v in (values[name], data.noise[name])
        )
        left = (values[name] - usual) / np.maximum(noise, 1e-300)
        if float(np.sqrt(np.mean(left**2))) < limits.HELD:
            values[name], noises[name] = usual, noise / np.sqrt(count)
            held.add(name)
    return replace(data, points=replace(data.points, values=values), noise=noises), frozenset(held)


def with_wobble(rows: Rows) -> Data:
    """The data with the noise of each output at least that between repeated visits to its states.

    Means have less noise than samples only if these are independent; slow fluctuations do not
    average out. They show in differences between successive blocks of one state, as an error of a
    law is the same in both.
    """
    system, data = rows.system, rows.system.data
    state = states_of(system)
    residual = rows.errors(system.flows(Configuration()))[0]
    noise = {name: values.copy() for name, values in data.noise.items()}
    for cell in rows.cells:
        off = np.einsum("nrs,ns->nr", np.linalg.inv(cell.whitener), cell.table(residual).T)
        for name, errors in zip(cell.outputs, off.T, strict=True):
            square = _between(state[cell.points], data.open[cell.points], errors)
            noise[name][cell.points] = np.maximum(noise[name][cell.points], np.sqrt(square))
    return replace(data, noise=noise)


def _between(state: NDArray[np.intp], open_: np.ndarray, errors: Array) -> float:
    """Robust variance of errors between visits to one state; 0 where there are too few."""
    steps = [np.diff(errors[(state == s) & open_ & np.isfinite(errors)]) for s in np.unique(state)]
    every = np.abs(np.concatenate(steps))
    if len(every) < limits.FEWEST_VISITS:
        return 0.0
    return (NORMAL_SPREAD * float(np.median(every))) ** 2 / 2.0


def _stretch(data: Data, state: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number of the stretch of time of each point, shape (n,): parts of blocks, as many as give
    about the wanted number of means."""
    n, states = len(data), int(state.max(initial=0)) + 1
    blocks = int(data.block.max(initial=0)) + 1
    parts = max(-(-limits.MOST_MEANS // (states * blocks)), 1) if n > limits.MOST_MEANS else n
    inside = np.zeros(n, dtype=np.intp)
    for block in np.unique(data.block):
        at = np.flatnonzero(data.block == block)
        inside[at] = np.arange(len(at)) * parts // max(len(at), 1)
    return np.asarray(data.block * parts + inside)
