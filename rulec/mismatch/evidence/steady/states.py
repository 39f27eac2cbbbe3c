"""Settled points as means per operating state and block of time.

What a state is follows from the inputs alone: points whose inputs agree are of one state. Visits
to one state within a block of time are one point; visits to different ones never are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.limits import NORMAL_SPREAD
from rulec_runtime.recordings.stationary import Stretches

from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import Flows, System


def states_of(system: System, share: float = limits.ALIKE_SHARE) -> NDArray[np.intp]:
    """Number of the operating state of each point, shape (n,).

    Inputs of one state agree within a `share` of their range, or within their noise.
    """
    columns = []
    for values, noise in _inputs(system).values():
        tolerance = max(share * float(np.ptp(values)), limits.ALIKE_NOISE * noise)
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
    """How alike errors of form of a module's laws are at two points, shape (n, n), 1 where equal.

    A law follows from what its module is set to and from the flow through it, and so does what is
    wrong with its form. The flow counts as the plant's inputs set it: a fault that changes it at
    the same inputs is no error of form. Errors bend, but have hardly any corners: the covariance is
    that of Matern with two derivatives.

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
    alike: Array = (1.0 + far + far**2 / 3.0) * np.exp(-far)
    return alike


def _flow_as_set(system: System, flows: Flows, module: str, inputs: Sequence[Array]) -> list[Array]:
    """The flow through a module as a quadratic function of all inputs, shape (n,), m3/s."""
    own = [i for i, o in enumerate(system.observers) if o.module == module]
    known = np.asarray(np.isfinite(flows.values[own]).any(axis=0))
    scaled = [(values - values.mean()) / values.std() for values in inputs]
    terms = [np.ones(len(known)), *scaled]
    terms += [one * other for i, one in enumerate(scaled) for other in scaled[: i + 1]]
    table = np.stack(terms, axis=1)
    if known.sum() <= 2 * table.shape[1]:
        table = table[:, : 1 + len(scaled)]
    middle = np.nanmedian(flows.values[own][:, known], axis=0)
    values: Array = table @ np.linalg.lstsq(table[known], middle, rcond=1e-6)[0]
    return [values] if _spread(values) > 0.0 else []


def _spread(values: Array) -> float:
    """Range of a course without its ends."""
    return float(np.subtract(*np.quantile(values, [0.95, 0.05])))


def _inputs(system: System) -> dict[str, tuple[Array, float]]:
    """Values of each recorded input, and its noise."""
    inputs = [s.id for s in system.ruleset.signals if s.is_input]
    return {name: _course(system, name) for name in inputs if name in system.data.values}


def _course(system: System, name: str) -> tuple[Array, float]:
    """Values of a reading, gaps at the median, and its noise."""
    values = system.data.values[name]
    known = np.nan_to_num(values, nan=float(np.nanmedian(values)))
    return known, float(np.nanmedian(system.data.noise[name]))


def rows_of_states(system: System, cuts: Array | None = None) -> Rows:
    """Rows whose points are means per operating state and block of time; none reaches over a cut,
    s, at which something began or ended."""
    data = averaged(system, np.zeros(0) if cuts is None else cuts)
    rows = rows_of(replace(system, data=data), Configuration())
    return rows_of(replace(rows.system, data=with_wobble(rows)), Configuration())


def averaged(system: System, cuts: Array) -> Data:
    """The data with one point for each state and block."""
    group = _groups(system, cuts)
    data, held = _with_held_inputs(system)
    count = np.bincount(group).astype(float)
    first = np.full(len(count), len(data))
    np.minimum.at(first, group, np.arange(len(data)))
    time = np.bincount(group, data.time) / count
    order = np.argsort(time)
    first = first[order]

    def mean(values: Array) -> Array:
        means: Array = (np.bincount(group, values) / count)[order]
        return means

    # The error of a held input is the same in all of its points.
    noise = {
        n: mean(v) if n in held else (np.sqrt(np.bincount(group, v**2)) / count)[order]
        for n, v in data.noise.items()
    }
    values = {name: mean(v) for name, v in data.points.values.items()}
    systematic = {name: mean(v) for name, v in data.points.systematic.items()}
    u = {name: np.hypot(systematic[name], noise.get(name, 0.0)) for name in values}
    points = Points(
        values, u, systematic, _at(data.points.bad, first), data.points.why, time[order]
    )
    stretches = Stretches(data.stretches.first[first], data.stretches.last[first])
    return replace(
        data,
        points=points,
        time=time[order],
        noise=noise,
        block=data.block[first],
        part=data.part[first],
        moving=_at(data.moving, first),
        stretches=stretches,
        source=data.source[first],
        clock=mean(data.clock),
    )


def _with_held_inputs(system: System) -> tuple[Data, frozenset[str]]:
    """The data with each input that is held while a state lasts at its mean there; which these are.

    Else every sample could have a true input of its own, and laws under which a reading no longer
    follows an input, as that of a relief valve at its pressure, would explain the input's noise.
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
    """The data with the noise of each output raised to what repeated visits to its states show.

    A mean over a block has less noise than its samples only where these are independent; what
    wobbles slowly does not average out. Seen are differences between blocks that follow each other
    in one state: what is wrong with a law is the same in both.
    """
    system, data = rows.system, rows.system.data
    state = states_of(system)
    setting = Configuration()
    residual = rows.errors(system.flows(setting))[0]
    noise = {name: values.copy() for name, values in data.noise.items()}
    for cell in rows.cells:
        off = np.einsum("nrs,ns->nr", np.linalg.inv(cell.whitener), cell.table(residual).T)
        for name, errors in zip(cell.outputs, off.T, strict=True):
            square = _between(state[cell.points], data.open[cell.points], errors)
            noise[name][cell.points] = np.maximum(noise[name][cell.points], np.sqrt(square))
    return replace(data, noise=noise)


def _between(state: NDArray[np.intp], open_: np.ndarray, errors: Array) -> float:
    """Variance of errors between visits to one state, robust; 0 where too few are seen."""
    steps = [np.diff(errors[(state == s) & open_ & np.isfinite(errors)]) for s in np.unique(state)]
    every = np.abs(np.concatenate(steps))
    if len(every) < limits.FEWEST_VISITS:
        return 0.0
    return (NORMAL_SPREAD * float(np.median(every))) ** 2 / 2.0


def _groups(system: System, cuts: Array) -> NDArray[np.intp]:
    """Number of the group of each point, shape (n,): of one state and block, and as usable."""
    data = system.data
    moving = [np.asarray(flags, dtype=int) for flags in data.moving.values()]
    bad = [np.asarray(flags) != 0 for flags in data.points.bad.values()]
    state = states_of(system)
    piece = np.searchsorted(cuts, data.time, side="right")
    key = np.stack([state, _stretch(data, state), piece, *moving, *bad], axis=1).astype(int)
    group: NDArray[np.intp] = np.unique(key, axis=0, return_inverse=True)[1].ravel()
    return group


def _stretch(data: Data, state: NDArray[np.intp]) -> NDArray[np.intp]:
    """Number of the stretch of time of each point, shape (n,): within its block, and so many that
    there are about as many means as are wanted."""
    n, states = len(data), int(state.max(initial=0)) + 1
    blocks = int(data.block.max(initial=0)) + 1
    parts = max(-(-limits.MOST_MEANS // (states * blocks)), 1) if n > limits.MOST_MEANS else n
    inside = np.zeros(n, dtype=np.intp)
    for block in np.unique(data.block):
        at = np.flatnonzero(data.block == block)
        inside[at] = np.arange(len(at)) * parts // max(len(at), 1)
    stretch: NDArray[np.intp] = data.block * parts + inside
    return stretch


def _at(flags: Mapping[str, np.ndarray], chosen: NDArray[np.intp]) -> dict[str, np.ndarray]:
    return {name: np.asarray(part)[chosen] for name, part in flags.items()}
