"""The cheapest sensor for explanations that no set points distinguish.

Candidates are a second reading of every signal that an estimate uses, and a flow meter in each
module, as for faults (`rulec/passes/sensor_advice.py`). Each explanation predicts the readings
of such a sensor at the recorded operating points. They differ if the distance exceeds the class of
the sensor and the uncertainty of both explanations, taken as independent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.algebra.tangent import run_with_slopes
from rulec.knowledge.knowledge import SensorClass
from rulec.knowledge.plant import Module
from rulec.language.units import VOLUME_FLOW
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import CHANGE
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry, driver_of
from rulec.mismatch.search.settled.posterior_curve import columns_of, size_of_term, solved

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
    its standard uncertainty, SI, at the recorded inputs `at`, SI, where they differ most; `apart`
    in standard deviations."""

    pair: tuple[int, int]
    sensor: Sensor
    values: tuple[float, float]
    u: float
    at: Mapping[str, float]
    apart: float


def advised(
    geometry: Geometry, models: Sequence[Model], pairs: Sequence[tuple[int, int]]
) -> tuple[Advised, ...]:
    """Sensors that distinguish pairs, the cheapest first for each pair."""
    system = geometry.rows.system
    claims = {number: _claims(system, models[number]) for number in {n for p in pairs for n in p}}
    sensors, found = list(_sensors(system)), list[Advised]()
    for pair in pairs:
        judged = [_judged(system, sensor, pair, *(claims[n] for n in pair)) for sensor in sensors]
        clear = [a for a in judged if a.apart**2 / 2.0 >= limits.TOLD_APART]
        found += sorted(clear, key=lambda a: (a.sensor.cost, -a.apart))
    return tuple(found)


Claims = Mapping[Quantity, tuple[Array, Array]]
"""Predictions of each quantity at the recorded points, SI, and their standard uncertainty, shape
(points,) each."""


def _judged(
    system: System, sensor: Sensor, pair: tuple[int, int], first: Claims, second: Claims
) -> Advised:
    """The distance of a pair by a sensor, at the point where it is largest."""
    (a, u_a), (b, u_b) = first[sensor.quantity], second[sensor.quantity]
    own = np.array([sensor.kind.uncertainty(sensor.full_scale, float(v)) for v in a])
    apart = np.nan_to_num(np.abs(a - b) / np.sqrt(own**2 + u_a**2 + u_b**2))
    place = int(np.argmax(apart))
    inputs = [s.id for s in system.ruleset.signals if s.is_input and s.id in system.data.values]
    return Advised(
        pair=pair,
        sensor=sensor,
        values=(float(a[place]), float(b[place])),
        u=float(own[place]),
        at={name: float(system.data.values[name][place]) for name in inputs},
        apart=float(apart[place]),
    )


def _claims(system: System, model: Model) -> Claims:
    solution, known = solved(model)
    numbers = np.arange(len(model.at))
    numbers = np.concatenate([numbers, *(columns_of(model, term) for term in model.terms)])
    at = np.concatenate([model.at, solution[numbers[len(model.at) :]]])
    covariance = known[np.ix_(numbers, numbers)]
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
    inputs, spots, of_signal = system.corrected(setting), list[str](), dict[str, Array]()
    own_spots, first = {spot.id for spot in builder.spots}, len(model.at)
    for term in model.terms:
        changed, size = term.changed, term.columns.shape[1]
        basis = term.basis.at(driver_of(system, term.driver)[: len(system.data)])
        shift = size_of_term(model, term) * basis @ at[first : first + size]
        first += size
        if changed.id in own_spots:
            spots.append(changed.id)
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
        plan = builder.plan(module, setting.ids, tuple(spots), definitions=True)
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
    plant = system.builder.network.plant
    for name in system.modules:
        module, classes = plant.modules[name], plant.knowledge.sensors
        for signal in module.type.signals.values():
            if f"{name}.{signal.name}" in system.shared:
                kind = classes[signal.sensor]
                yield Sensor(
                    quantity=(name, signal.name),
                    title=f"a second reading of {name}.{signal.name}",
                    kind=kind,
                    full_scale=signal.full_scale,
                    unit=signal.unit.text,
                    factor=signal.unit.factor,
                    cost=kind.cost,
                )
        yield from _flow_meter(system, module)


def _flow_meter(system: System, module: Module) -> Iterator[Sensor]:
    """The flow meter that the type declares, else one of the cheapest class that measures flows."""
    knowledge = system.builder.network.plant.knowledge
    classes, quantities = knowledge.sensors, knowledge.units.quantities
    name = module.name
    declared = [s for s in module.type.signals.values() if s.unit.dimension == VOLUME_FLOW]
    if any(f"{name}.{s.name}" in system.shared for s in declared):
        return
    fitting = [
        (c, None, "l/h", 1e-3 / 3600.0)
        for c in sorted(classes.values(), key=lambda c: c.cost)
        if quantities.get(c.measures) == VOLUME_FLOW and c.kind != "full scale"
    ]
    own = [(classes[s.sensor], s.full_scale, s.unit.text, s.unit.factor) for s in declared]
    for kind, full_scale, unit, factor in [*own, *fitting][:1]:
        reading = f"{name}.{declared[0].name}" if declared else ""
        recorded = bool(np.isfinite(system.data.values.get(reading, np.nan)).any())
        unused = f"{reading}, which is recorded and which no relation uses"
        yield Sensor(
            quantity=(name, ""),
            title=unused if recorded else f"a flow meter in {name}",
            kind=kind,
            full_scale=full_scale,
            unit=unit,
            factor=factor,
            cost=0.0 if recorded else kind.cost,
        )
