"""Sensors that could be added to a module: second readings, and a flow meter."""

from __future__ import annotations

from collections.abc import Iterable

from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.module_type import Signal
from rulec.knowledge.plant import Module
from rulec.language.units import VOLUME_FLOW
from rulec.passes.linearise import Linearised
from rulec.passes.neighbourhood import Sensor


def candidates(module: Module, knowledge: Knowledge, tables: Linearised) -> Iterable[Sensor]:
    """A second reading of every own signal that an estimate uses, and a flow meter."""
    observers = [f"{module.name}.{o}" for o in module.type.observers]
    inputs = {name for observer in observers for name in tables.gradients[observer]}
    used = [s for s in module.type.signals.values() if f"{module.name}.{s.name}" in inputs]
    for signal in used:
        reading = f"{module.name}.{signal.name}"
        yield Sensor(
            module=module.name,
            signal=signal.name,
            title=f"a second reading of {reading}",
            cost=knowledge.sensors[signal.sensor].cost,
            existing=reading,
            is_estimate=False,
            u=tables.uncertainties[reading],
        )
    if observers and not any(_is_flow(signal) for signal in used):
        yield from _flow_meter(module, knowledge, observers[0], tables.flows[observers[0]])


def _flow_meter(
    module: Module, knowledge: Knowledge, estimate: str, flow: float
) -> Iterable[Sensor]:
    """As declared by the type, which no estimate uses, else of the cheapest fitting class."""
    classes, quantities = knowledge.sensors, knowledge.units.quantities
    declared = [
        (classes[s.sensor], s.name, s.full_scale)
        for s in module.type.signals.values()
        if _is_flow(s)
    ]
    fitting = [
        (c, c.measures, None)
        for c in classes.values()
        if quantities.get(c.measures) == VOLUME_FLOW and c.kind != "full scale"
    ]
    for sensor, name, full_scale in sorted(declared or fitting, key=lambda k: k[0].cost)[:1]:
        yield Sensor(
            module=module.name,
            signal=name,
            title=f"a flow meter in {module.name}",
            cost=sensor.cost,
            existing=estimate,
            is_estimate=True,
            u=sensor.uncertainty(full_scale, flow),
        )


def _is_flow(signal: Signal) -> bool:
    return signal.unit.dimension == VOLUME_FLOW
