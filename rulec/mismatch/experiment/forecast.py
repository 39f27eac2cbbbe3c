"""What each explanation predicts for readings at operating points that were not recorded."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.stationary import Stretches

from rulec.algebra.tangent import run_with_slopes
from rulec.knowledge.knowledge import SensorClass
from rulec.language.units import VOLUME_FLOW
from rulec.mismatch import limits
from rulec.mismatch.evidence.configuration import (
    CHANGE,
    ERROR,
    Configuration,
    reading_and_recording,
)
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence
from rulec.mismatch.evidence.steady.fit import Fitted, evaluated
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.screen import column_at
from rulec.mismatch.evidence.steady.system import System, with_properties
from rulec.mismatch.evidence.steady.terms import driver_of
from rulec.mismatch.search.refit import Model


@dataclass(frozen=True)
class SetPoints:
    """Operating points that could be run, n of them.

    `inputs` are values of the inputs, SI, shape (n,) each, `around` those of readings that are not
    set; noise and all else are as at the recorded point `near`, shape (n,). `time` is the time of
    each, s on the clock of the recording.
    """

    inputs: Mapping[str, Array]
    near: NDArray[np.intp]
    time: Array
    around: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.near)


@dataclass(frozen=True)
class Forecast:
    """Readings if one explanation is true, and how far off every explanation would find them.

    `readings` per output have shape (n,), SI. `point` has the point of each row, shape (rows,). For
    each explanation, `off`, shape (rows,), in units of the noise, is the residual of its best
    values, and `covariance`, shape (rows, rows), is due to noise, values and errors of form.
    `spread` per output, shape (n,), SI, is the standard deviation of a reading, NaN if none is
    predicted, and `noise` the part of it that a longer mean averages. For each explanation that
    part has the variance `shares` in `covariance`; means have this share `less` of it (0: the
    shortest means), which `spread` includes already. `flows` per module, shape (n,), m3/s.
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
        """Covariance of some rows with others by an explanation, broadcast; a row below 0 is
        padding with a variance of its own."""
        gone = self.less * self.shares[explanation] if self.less else 0.0
        inside, same = (rows >= 0) & (others >= 0), rows == others
        found: Array = self.covariance[explanation][rows, others] - gone * same
        return np.where(inside, found, same)

    def held(self, times: float) -> Forecast:
        """The same for means over `times` as many settled samples: only their noise averages."""
        less = 1.0 - 1.0 / times
        spread = {n: np.sqrt(v**2 - less * self.noise[n] ** 2) for n, v in self.spread.items()}
        return replace(self, less=less, spread=spread)


def forecast(
    evidence: SteadyEvidence, models: Sequence[Model], true: int, points: SetPoints
) -> Forecast:
    """What would be read if one of some models were true."""
    recorded = evidence.system
    data = with_properties(recorded.builder, data_at(recorded.data, points))
    system = replace(recorded, data=data)
    model = models[true]
    for _ in range(limits.FORETELL_STEPS):
        rows = rows_of(system, Configuration())
        system = replace(system, data=_moved(rows, _evaluated(rows, model)))
    rows = rows_of(system, Configuration())
    there = SteadyEvidence(rows)
    outputs = {name for cell in rows.cells for name in cell.outputs}
    readings = {name: rows.system.data.values[name] for name in sorted(outputs)}
    off, covariance = zip(*(_residuals_by(there, m) for m in models), strict=True)
    shares = tuple(min(own.scale, 1.0) ** 2 for own in models)
    return Forecast(
        readings=readings,
        point=there.point,
        off=off,
        covariance=covariance,
        spread=_spread(rows, there, covariance[true]),
        noise=_spread(rows, there, shares[true] * np.eye(len(there.point))),
        shares=shares,
        flows=_flows(rows.system, model),
    )


def _spread(rows: Rows, there: SteadyEvidence, covariance: Array) -> dict[str, Array]:
    """Standard deviation of each output, shape (n,), SI; NaN if it is not predicted."""
    number = np.cumsum(there.open) - 1
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
    values = system.flows(_later(model, system.data.time)).values
    of = np.array([o.module for o in system.observers])
    return {module: np.mean(values[of == module], axis=0) for module in system.modules}


def data_at(data: Data, points: SetPoints) -> Data:
    """Points as if they had been recorded; readings are those of the nearest recorded point."""
    near, n = points.near, len(points)

    def taken(values: Mapping[str, Array]) -> dict[str, Array]:
        return {name: np.asarray(column)[near] for name, column in values.items()}

    moved = replace(
        data.points,
        values={**taken(data.points.values), **points.around, **points.inputs},
        u=taken(data.points.u),
        systematic=taken(data.points.systematic),
        bad=dict.fromkeys(data.points.bad, np.zeros(n, dtype=bool)),
        time=points.time,
    )
    return replace(
        data,
        points=moved,
        time=points.time,
        noise=taken(data.noise),
        block=np.zeros(n, dtype=np.intp),
        part=np.zeros(n, dtype=np.intp),
        moving={},
        stretches=Stretches(np.arange(n), np.arange(n) + 1),
        source=data.source[near],
        # The time after the nearest point is the same on its own clock as on the recording's.
        clock=data.clock[near] + points.time - data.time[near],
    )


def _evaluated(rows: Rows, model: Model) -> Fitted:
    data, at = rows.system.data, model.at * _persistence(model)[0]
    return evaluated(rows, _later(model, data.time), model.prior, at, data.open)


def _later(model: Model, time: Array) -> Configuration:
    """The setting at other times, s, with the same values; growth has gone on until then."""
    courses = tuple(course.at_times(time) for course in model.setting.courses)
    return replace(model.setting, courses=courses)


def _persistence(model: Model) -> tuple[Array, NDArray[np.intp], float]:
    """The part of each value that holds for a further recording, shape (values,), 1 except for
    errors of sensors; which values are persistent errors, and the variance that a further recording
    adds to them. It is judged with the last one, and each has errors of its own besides."""
    names = model.prior.names
    own = [name.startswith(ERROR) and reading_and_recording(name)[1] is not None for name in names]
    stay = [name.startswith(ERROR) for name in names] & ~np.array(own, dtype=bool)
    share = np.where(own, 0.0, 1.0)
    if any(own):
        return share, np.flatnonzero(stay), limits.OWN_ERROR
    # One recording does not show which part of an error persists; `alike` is their correlation.
    alike = 1.0 - limits.OWN_ERROR
    return np.where(stay, alike, share), np.flatnonzero(stay), 1.0 - alike**2


def _moved(rows: Rows, fitted: Fitted) -> Data:
    """The data with each output moved to where a model predicts it."""
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


def _residuals_by(there: SteadyEvidence, model: Model) -> tuple[Array, Array]:
    """Residuals of readings by a model, shape (rows,), and their covariance, shape
    (rows, rows), due to noise, values, terms without a name, errors of form, and new errors of
    sensors."""
    fitted = _evaluated(there.rows, model)
    solution, posterior = model.solved
    off = fitted.residual[there.open]
    share, stay, added = _persistence(model)
    by_value = fitted.jacobian[there.open]
    table, numbers = [by_value * share], list(range(len(model.at)))
    for term in model.terms:
        own, slope = model.columns_of(term), column_at(fitted, term.changed)
        # Residuals by the functions of the term, each of prior unit size.
        columns = term.basis.at(driver_of(there.system, term.driver)[there.point])
        shown = 0.0 if slope is None else slope[there.open, None]
        columns = model.size_of(term) * shown * columns
        off = off + columns @ solution[own]
        table.append(columns)
        numbers += own.tolist()
    slopes = np.concatenate(table, axis=1)
    forms = model.sizes.of(there.law) * there.forms
    covariance: Array = slopes @ posterior[np.ix_(numbers, numbers)] @ slopes.T + forms @ forms.T
    covariance += added * by_value[:, stay] @ by_value[:, stay].T
    covariance[np.diag_indices(len(covariance))] += model.scale**2
    return off, covariance


# The cheapest sensor for explanations that no set points distinguish.
#
# Candidates are a second reading of every signal that an estimate uses, and a flow meter in each
# module, as for faults (`rulec/passes/sensor_advice.py`). Each explanation predicts the readings
# of such a sensor at the recorded operating points. They differ if the distance exceeds the class
# of the sensor and the uncertainty of both explanations, taken as independent.

Quantity = tuple[str, str]
"""A module and its signal; an empty signal for the flow through the module."""


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A possible sensor: `quantity` is what it reads, `title` its description.

    Values are shown in `unit`, SI = shown * `factor`; `cost` is relative to a pressure transmitter.
    """

    quantity: Quantity
    title: str
    kind: SensorClass
    full_scale: float | None
    unit: str
    factor: float
    cost: float


@dataclass(frozen=True, kw_only=True)
class Advised:
    """A sensor that distinguishes two explanations, by their numbers: its reading under each and
    its standard uncertainty, SI, at the recorded point where they differ most; `apart` in standard
    deviations."""

    pair: tuple[int, int]
    sensor: Sensor
    values: tuple[float, float]
    u: float
    apart: float


def advised(
    evidence: SteadyEvidence, models: Sequence[Model], pairs: Sequence[tuple[int, int]]
) -> tuple[Advised, ...]:
    """Sensors that distinguish pairs, the cheapest first for each pair."""
    system = evidence.system
    claims = {number: _claims(system, models[number]) for number in {n for p in pairs for n in p}}
    sensors, found = list(_sensors(system)), list[Advised]()
    for pair in pairs:
        clear = []
        for sensor in sensors:
            (a, u_a), (b, u_b) = (claims[number][sensor.quantity] for number in pair)
            own = np.array([sensor.kind.uncertainty(sensor.full_scale, float(v)) for v in a])
            apart = np.nan_to_num(np.abs(a - b) / np.sqrt(own**2 + u_a**2 + u_b**2))
            i = int(np.argmax(apart))
            one = Advised(
                pair=pair,
                sensor=sensor,
                values=(float(a[i]), float(b[i])),
                u=float(own[i]),
                apart=float(apart[i]),
            )
            if one.apart**2 / 2.0 >= limits.TOLD_APART:
                clear.append(one)
        found += sorted(clear, key=lambda one: (one.sensor.cost, -one.apart))
    return tuple(found)


Claims = Mapping[Quantity, tuple[Array, Array]]
"""Predictions of each quantity at the recorded points, SI, and their standard uncertainty, shape
(points,) each."""


def _claims(system: System, model: Model) -> Claims:
    solution, posterior = model.solved
    numbers = np.arange(len(model.at))
    numbers = np.concatenate([numbers, *(model.columns_of(term) for term in model.terms)])
    at = np.concatenate([model.at, solution[numbers[len(model.at) :]]])
    covariance = posterior[np.ix_(numbers, numbers)]
    value = _claimed(system, model, at)
    steps = limits.CLAIM_STEP * np.diag(np.sqrt(np.diag(covariance)))
    moved = [(_claimed(system, model, at + step), step.sum()) for step in steps]
    claims = {}
    for quantity, own in value.items():
        slopes = np.stack([(there[quantity] - own) / size for there, size in moved])
        claims[quantity] = (own, np.sqrt(np.einsum("in,ij,jn->n", slopes, covariance, slopes)))
    return claims


def _claimed(system: System, model: Model, at: Array) -> dict[Quantity, Array]:
    """Values of all quantities for given numbers of a model: its own, then those of its terms."""
    builder, count = system.builder, len(model.prior.names)
    values = dict(zip(model.prior.names, at[:count].tolist(), strict=True))
    setting = replace(model.setting, values={**model.setting.values, **values})
    inputs, locations, of_signal = system.corrected(setting), list[str](), dict[str, Array]()
    ids, first = {location.id for location in builder.locations}, len(model.at)
    for term in model.terms:
        changed, size = term.changed, term.columns.shape[1]
        basis = term.basis.at(driver_of(system, term.driver)[: len(system.data)])
        shift = model.size_of(term) * basis @ at[first : first + size]
        first += size
        if changed.id in ids:
            locations.append(changed.id)
            inputs[changed.unknown] = shift
        else:
            # The unknown of a parameter is its change.
            name = changed.unknown.removesuffix(CHANGE)
            inputs[name] = inputs[name] + shift
        if changed.kind == "signal":
            of_signal[f"{changed.module}.{changed.place}"] = np.asarray(inputs[changed.unknown])
    found: dict[Quantity, Array] = {}
    everywhere = np.zeros(len(system.data))
    observed = {c.id: {o.partition(".")[0] for o in c.observers} for c in setting.joined}
    for module in system.modules:
        plan = builder.plan(module, setting.ids, tuple(locations), definitions=True)
        out = run_with_slopes(plan, inputs, ())[0]
        flows = [out[f"q:{o.id}"] + everywhere for o in system.observers if o.module == module]
        found[module, ""] = np.median(flows, axis=0)  # One estimate may diverge.
        joined = tuple(id_ for id_ in setting.ids if module in observed[id_])
        corrected = builder.amended(module, joined).corrected
        for name in system.shared:
            owner, _, signal = name.partition(".")
            if owner == module:
                shown = out[f"d:{corrected[signal]}"] if signal in corrected else inputs[name]
                found[module, signal] = shown - of_signal.get(name, everywhere)
    return found


def _sensors(system: System) -> Iterator[Sensor]:
    """A second reading of each signal in use, and per module a flow meter if none is: the one that
    its type declares, else one of the cheapest class that measures flows."""
    knowledge = system.builder.network.plant.knowledge
    classes, quantities = knowledge.sensors, knowledge.units.quantities
    fitting = [
        (c, None, "l/h", 1e-3 / 3600.0)
        for c in sorted(classes.values(), key=lambda c: c.cost)
        if quantities.get(c.measures) == VOLUME_FLOW and c.kind != "full scale"
    ]
    for name in system.modules:
        declared, metered = [], False
        for signal in system.builder.network.plant.modules[name].type.signals.values():
            kind, unit, reading = classes[signal.sensor], signal.unit, f"{name}.{signal.name}"
            is_flow, used = unit.dimension == VOLUME_FLOW, reading in system.shared
            if is_flow:
                declared.append((reading, (kind, signal.full_scale, unit.text, unit.factor)))
            if used:
                metered |= is_flow
                yield Sensor(
                    quantity=(name, signal.name),
                    title=f"a second reading of {reading}",
                    kind=kind,
                    full_scale=signal.full_scale,
                    unit=unit.text,
                    factor=unit.factor,
                    cost=kind.cost,
                )
        meters = [] if metered else [*declared, *(("", meter) for meter in fitting)]
        for reading, (kind, full_scale, text, factor) in meters[:1]:
            recorded = bool(np.isfinite(system.data.values.get(reading, np.nan)).any())
            unused = f"{reading}, which is recorded and which no relation uses"
            yield Sensor(
                quantity=(name, ""),
                title=unused if recorded else f"a flow meter in {name}",
                kind=kind,
                full_scale=full_scale,
                unit=text,
                factor=factor,
                cost=0.0 if recorded else kind.cost,
            )
