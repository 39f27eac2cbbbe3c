"""Where no set points tell explanations apart: the cheapest sensor that would.

Looked at are a second reading of every signal that an estimate uses, and a flow meter in each
module, as for faults (`rulec/passes/candidates.py`). Each explanation says what it would have read
at the operating points recorded; those are apart where the difference exceeds the class of the
sensor and the doubt of both explanations, which is counted as if they shared none of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rulec.knowledge.knowledge import SensorClass
from rulec.knowledge.plant import Module
from rulec.language.units import VOLUME_FLOW
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.predicted_quantities import Claims, Quantity, claims_of
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.settled.geometry import Geometry


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """A sensor that could be read: `quantity` is what, `title` the words for it, `reading` the id
    of a signal that shows the same or that is recorded and not used.

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
    """A sensor that tells two explanations apart, by their numbers: what it reads under each, and
    its standard uncertainty, SI, at the recorded inputs `at`, SI, where it tells most; `apart` in
    standard deviations."""

    pair: tuple[int, int]
    sensor: Sensor
    values: tuple[float, float]
    u: float
    at: Mapping[str, float]
    apart: float


def advised(
    geometry: Geometry, models: Sequence[Model], pairs: Sequence[tuple[int, int]]
) -> tuple[Advised, ...]:
    """Sensors that tell pairs apart, of each pair the cheapest first."""
    needed = sorted({number for pair in pairs for number in pair})
    claims = {number: claims_of(geometry, models[number]) for number in needed}
    system = geometry.rows.system
    sensors = list(_sensors(system))
    found: list[Advised] = []
    for pair in pairs:
        judged = (_judged(system, sensor, pair, claims) for sensor in sensors)
        told = [a for a in judged if a is not None and a.apart**2 / 2.0 >= limits.TOLD_APART]
        found += sorted(told, key=lambda a: (a.sensor.cost, -a.apart))
    return tuple(found)


def _judged(
    system: System, sensor: Sensor, pair: tuple[int, int], claims: Mapping[int, Claims]
) -> Advised | None:
    """How far a sensor tells a pair apart where it tells most; None where nothing is known."""
    first, second = (claims[number] for number in pair)
    a, b = first.value[sensor.quantity], second.value[sensor.quantity]
    own = np.array([sensor.kind.uncertainty(sensor.full_scale, float(v)) for v in a])
    doubt = np.sqrt(own**2 + first.u[sensor.quantity] ** 2 + second.u[sensor.quantity] ** 2)
    with np.errstate(invalid="ignore"):
        apart = np.abs(a - b) / doubt
    if not np.isfinite(apart).any():
        return None
    place = int(np.nanargmax(apart))
    inputs = [s.id for s in system.ruleset.signals if s.is_input and s.id in system.data.values]
    return Advised(
        pair=pair,
        sensor=sensor,
        values=(float(a[place]), float(b[place])),
        u=float(own[place]),
        at={name: float(system.data.values[name][place]) for name in inputs},
        apart=float(apart[place]),
    )


def _sensors(system: System) -> Iterator[Sensor]:
    plant = system.builder.network.plant
    for name in system.modules:
        module, classes = plant.modules[name], plant.knowledge.sensors
        for signal in module.type.signals.values():
            reading = f"{name}.{signal.name}"
            if reading in system.shared:
                kind = classes[signal.sensor]
                yield Sensor(
                    quantity=(name, signal.name),
                    title=f"a second reading of {reading}",
                    kind=kind,
                    full_scale=signal.full_scale,
                    unit=signal.unit.text,
                    factor=signal.unit.factor,
                    cost=kind.cost,
                )
        yield from _flow_meter(system, module)


def _flow_meter(system: System, module: Module) -> Iterator[Sensor]:
    """The one that the type declares, or else the cheapest of a class that measures flows."""
    knowledge = system.builder.network.plant.knowledge
    classes, quantities = knowledge.sensors, knowledge.units.quantities
    declared = [s for s in module.type.signals.values() if s.unit.dimension == VOLUME_FLOW]
    if any(f"{module.name}.{s.name}" in system.shared for s in declared):
        return
    for signal in declared:
        reading, kind = f"{module.name}.{signal.name}", classes[signal.sensor]
        recorded = bool(np.isfinite(system.data.values.get(reading, np.nan)).any())
        used = f"{reading}, which is recorded and which no relation uses"
        yield Sensor(
            quantity=(module.name, ""),
            title=used if recorded else f"a flow meter in {module.name}",
            kind=kind,
            full_scale=signal.full_scale,
            unit=signal.unit.text,
            factor=signal.unit.factor,
            cost=0.0 if recorded else kind.cost,
        )
        return
    fitting = [
        c
        for c in classes.values()
        if quantities.get(c.measures) == VOLUME_FLOW and c.kind != "full scale"
    ]
    for kind in sorted(fitting, key=lambda c: c.cost)[:1]:
        yield Sensor(
            quantity=(module.name, ""),
            title=f"a flow meter in {module.name}",
            kind=kind,
            full_scale=None,
            unit="l/h",
            factor=1e-3 / 3600.0,
            cost=kind.cost,
        )
