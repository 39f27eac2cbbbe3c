"""What each explanation foretells of readings at operating points that nobody has recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.stationary import Stretches
from scipy.linalg import block_diag

from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import (
    ERROR,
    Configuration,
    reading_and_recording,
)
from rulec.mismatch.evidence.steady.fit import Fitted, evaluated
from rulec.mismatch.evidence.steady.locate import spot_column
from rulec.mismatch.evidence.steady.onset import slope_by_onset
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import System, with_properties
from rulec.mismatch.search.evidence import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, driver_of
from rulec.mismatch.search.settled.posterior_curve import columns_of, size_of_term, solved


@dataclass(frozen=True)
class Places:
    """Operating points that could be run, n of them.

    `inputs` are values of what is set, SI, shape (n,) each, `around` of what nobody sets; noise and
    all else is as at the recorded point `near`, shape (n,). `time`, s on the clock of the
    recording, is when.
    """

    inputs: Mapping[str, Array]
    near: NDArray[np.intp]
    time: Array
    around: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.near)


@dataclass(frozen=True)
class Foretold:
    """Readings if one explanation is true, and how far off every explanation would find them.

    `readings` per output have shape (n,), SI. `point` has the place of each row, shape (rows,). Of
    each explanation in turn `off`, shape (rows,), in units of the noise, is what its best values
    leave, and `covariance`, shape (rows, rows), what noise, values and errors of form may add.
    `spread` per output, shape (n,), SI, is the standard deviation of a reading, NaN where nothing
    is foretold, and `noise` the part of it that a longer mean averages; of each explanation that
    part has the variance `shares` in `covariance`, of which means have `less` by this share (0: as
    short as they can be); `spread` has it already. `flows` per module, shape (n,), m3/s.
    """

    readings: Mapping[str, Array]
    point: NDArray[np.intp]
    off: tuple[Array, ...]
    covariance: tuple[Array, ...]
    spread: Mapping[str, Array] = field(default_factory=dict)
    noise: Mapping[str, Array] = field(default_factory=dict)
    shares: tuple[float, ...] = ()
    less: float = 0.0
    flows: Mapping[str, Array] = field(default_factory=dict)

    def between(self, explanation: int, rows: NDArray[np.intp], others: NDArray[np.intp]) -> Array:
        """Covariance of some rows with others by an explanation, broadcast; a row below 0 stands
        for no reading, with a variance of its own."""
        gone = self.less * self.shares[explanation] if self.less else 0.0
        known, same = (rows >= 0) & (others >= 0), rows == others
        found: Array = self.covariance[explanation][rows, others] - gone * same
        return np.where(known, found, same)

    def held(self, times: float) -> Foretold:
        """Of means over so many times as many settled samples: their noise alone averages."""
        less = 1.0 - 1.0 / times
        spread = {
            name: np.sqrt(whole**2 - less * self.noise[name] ** 2)
            for name, whole in self.spread.items()
        }
        return replace(self, less=less, spread=spread)


def foretold(geometry: Geometry, models: Sequence[Model], true: int, places: Places) -> Foretold:
    """What would be read if one of some models were true."""
    recorded = geometry.rows.system
    data = with_properties(recorded.builder, data_at(recorded.data, places))
    system = replace(recorded, data=data)
    model = models[true]
    for _ in range(limits.FORETELL_STEPS):
        rows = rows_of(system, Configuration())
        fitted = _evaluated(rows, model)
        system = replace(system, data=_moved(rows, fitted))
    rows = rows_of(system, Configuration())
    there = Geometry(rows)
    views = [_seen_by(geometry, there, own) for own in models]
    outputs = {name for cell in rows.cells for name in cell.outputs}
    readings = {name: rows.system.data.values[name] for name in sorted(outputs)}
    off, covariance = zip(*views, strict=True)
    shares = tuple(min(own.scale, 1.0) ** 2 for own in models)
    return Foretold(
        readings=readings,
        point=there.point,
        off=off,
        covariance=covariance,
        spread=_spread(rows, there, covariance[true]),
        noise=_spread(rows, there, shares[true] * np.eye(len(there.point))),
        shares=shares,
        flows=_flows(rows.system, model),
    )


def _spread(rows: Rows, there: Geometry, covariance: Array) -> dict[str, Array]:
    """Standard deviation of each output, shape (n,), SI; NaN where it is not foretold."""
    number = np.cumsum(there.seen) - 1
    spread: dict[str, Array] = {}
    for cell in rows.cells:
        own = np.arange(cell.rows.start, cell.rows.stop).reshape(cell.rank, len(cell.points)).T
        blocks = covariance[number[own][:, :, None], number[own][:, None, :]]
        back = np.linalg.inv(cell.whitener)
        variance = np.einsum("nij,njk,nik->ni", back, blocks, back)
        for name, column in zip(cell.outputs, variance.T, strict=True):
            whole = spread.setdefault(name, np.full(len(rows.system.data), np.nan))
            whole[cell.points] = np.sqrt(column)
    return spread


def _flows(system: System, model: Model) -> dict[str, Array]:
    """Flows of modules by a model, m3/s, shape (n,) each."""
    setting = _later(model.setting, system.data.time)
    values = system.flows(setting).values
    members: dict[str, list[int]] = {}
    for i, observer in enumerate(system.observers):
        members.setdefault(observer.module, []).append(i)
    return {module: np.mean(values[own], axis=0) for module, own in members.items()}


def data_at(data: Data, places: Places) -> Data:
    """Points as if they had been recorded; readings are those of the recorded point nearest."""
    near, n = places.near, len(places)

    def taken(values: Mapping[str, Array]) -> dict[str, Array]:
        return {name: np.asarray(column)[near] for name, column in values.items()}

    values = {**taken(data.points.values), **places.around, **places.inputs}
    nothing = np.zeros(n, dtype=bool)
    points = replace(
        data.points,
        values=values,
        u=taken(data.points.u),
        systematic=taken(data.points.systematic),
        bad=dict.fromkeys(data.points.bad, nothing),
        time=places.time,
    )
    return replace(
        data,
        points=points,
        time=places.time,
        noise=taken(data.noise),
        block=np.zeros(n, dtype=np.intp),
        part=np.zeros(n, dtype=np.intp),
        moving={},
        stretches=Stretches(np.arange(n), np.arange(n) + 1),
        source=data.source[near],
        # As long after the nearest point on its own clock as on that of the recording.
        clock=data.clock[near] + places.time - data.time[near],
    )


def _later(setting: Configuration, time: Array) -> Configuration:
    """A setting at other times, s, its values as they are: what grows has grown further there."""
    return replace(setting, courses=tuple(course.at_times(time) for course in setting.courses))


def _evaluated(rows: Rows, model: Model) -> Fitted:
    """A model at points of a further recording."""
    setting = _later(model.setting, rows.system.data.time)
    at = model.at * _kept(model)[0]
    return evaluated(rows, setting, model.prior, at, rows.system.data.open)


def _kept(model: Model) -> tuple[Array, NDArray[np.intp], float]:
    """What of each value a further recording keeps, shape (values,), 1 but for errors of sensors;
    which values are errors that stay, and the variance of what a further recording adds to them.

    It is judged with the last one: there each has errors of its own besides those that stay.
    """
    names = model.prior.names
    own = [name.startswith(ERROR) and reading_and_recording(name)[1] is not None for name in names]
    stay = [name.startswith(ERROR) for name in names] & ~np.array(own, dtype=bool)
    kept = np.where(own, 0.0, 1.0)
    if any(own):
        return kept, np.flatnonzero(stay), limits.OWN_ERROR
    # Of one recording it is not known which part of an error stays: two are alike by so much.
    alike = 1.0 - limits.OWN_ERROR
    return np.where(stay, alike, kept), np.flatnonzero(stay), 1.0 - alike**2


def _moved(rows: Rows, fitted: Fitted) -> Data:
    """The data with each output where a model says that it would be."""
    data = rows.system.data
    values = dict(data.points.values)
    for cell in rows.cells:
        off = np.linalg.solve(cell.whitener, cell.table(fitted.residual).T[:, :, None])[:, :, 0]
        for name, errors in zip(cell.outputs, off.T, strict=True):
            moved = values[name].copy()
            step = limits.FORETELL_STEP * np.maximum(np.abs(moved[cell.points]), 1e-12)
            moved[cell.points] -= np.clip(np.nan_to_num(errors), -step, step)
            values[name] = moved
    return replace(data, points=replace(data.points, values=values))


def known_with_onsets(geometry: Geometry, model: Model) -> Array:
    """Covariance of all numbers of a model and, behind them, of when each fault that grows began,
    s, shape (numbers, numbers).

    A later beginning asks for a faster growth: with it held, later readings would be foretold too
    surely. Before the recording each time in it is as likely.
    """
    slopes = _slopes_by_onsets(model.fitted)[geometry.seen]
    length = max(float(np.ptp(geometry.rows.system.data.time)), 1e-300)
    before = 12.0 / length**2 * np.eye(slopes.shape[1])
    table, precision = np.hstack([model.table, slopes]), block_diag(model.precision, before)
    return solved(replace(model, table=table, precision=precision))[1]


def _slopes_by_onsets(fitted: Fitted) -> Array:
    """Slopes of all residuals by when each fault that grows began, 1/s, shape (rows, faults)."""
    names = fitted.prior.names
    growing = [course for course in fitted.setting.courses if course.grows]
    found = [slope_by_onset(fitted, c, names.index(c.names()[0])) for c in growing]
    return np.stack(found, axis=1) if found else np.zeros((len(fitted.residual), 0))


def _seen_by(geometry: Geometry, there: Geometry, model: Model) -> tuple[Array, Array]:
    """How far off a model of `geometry` finds readings, shape (rows,), and the covariance of that,
    shape (rows, rows): of noise, its values, when faults began to grow, terms without a name,
    errors of form, and of sensors anew."""
    fitted = _evaluated(there.rows, model)
    solution, known = solved(model)[0], known_with_onsets(geometry, model)
    off = fitted.residual[there.seen]
    kept, stay, added = _kept(model)
    by_value = fitted.jacobian[there.seen]
    table, numbers = [by_value * kept], list(range(len(model.at)))
    for term in model.terms:
        own, columns = columns_of(model, term), _columns(there, model, fitted, term)
        off = off + columns @ solution[own]
        table.append(columns)
        numbers += own.tolist()
    table.append(_slopes_by_onsets(fitted)[there.seen])
    numbers += range(len(solution), len(known))
    slopes = np.concatenate(table, axis=1)
    forms = model.sizes.of(there.law) * there.forms
    covariance: Array = slopes @ known[np.ix_(numbers, numbers)] @ slopes.T + forms @ forms.T
    covariance += added * by_value[:, stay] @ by_value[:, stay].T
    covariance[np.diag_indices(len(covariance))] += model.scale**2
    return off, covariance


def _columns(there: Geometry, model: Model, fitted: Fitted, term: Term) -> Array:
    """Functions of a term as they show, each of unit size before, shape (rows, functions)."""
    slopes = spot_column(fitted, term.changed)
    driver = driver_of(there.rows.system, term.driver)[there.point]
    basis = term.basis.at(driver)
    if slopes is None:
        return np.zeros_like(basis)
    columns: Array = size_of_term(model, term) * slopes[there.seen, None] * basis
    return columns
