"""Modules that sensors of states observe: a flow changes a level, which changes another flow."""

from __future__ import annotations

from rulec.knowledge.plant import Plant
from rulec.passes.link import Network


def seen_through_states(network: Network) -> set[str]:
    """Modules whose flows or states move a reading that is recorded, by way of balances."""
    upstream: dict[str, set[str]] = {}
    for (module, end), terms in network.ends.items():
        if end in network.plant.modules[module].type.read:
            upstream.setdefault(module, set()).update(known.module for _, known in terms)
    for (module, _), signals in network.gathers.items():
        upstream.setdefault(module, set()).update(m for m, _ in signals)
    seen: set[str] = set()
    waiting = _with_sensors(network.plant)
    while waiting:
        module = waiting.pop()
        if module not in seen:
            seen.add(module)
            waiting += upstream.get(module, ())
    return seen


def _with_sensors(plant: Plant) -> list[str]:
    """Modules with a reading of their states; where columns are mapped, one that is recorded."""
    mapped = {column.signal for column in plant.columns}
    return [
        module.name
        for module in plant.modules.values()
        if any(not mapped or f"{module.name}.{name}" in mapped for name in module.type.readings)
    ]
