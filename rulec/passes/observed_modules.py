"""Modules that sensors observe through states: a flow changes a level, which changes a flow."""

from __future__ import annotations

from rulec.passes.link import Network


def seen_through_states(network: Network) -> set[str]:
    """Modules whose flows or states affect a recorded reading through balances.

    If the plant maps columns, only mapped readings count as recorded.
    """
    upstream: dict[str, set[str]] = {}
    for (module, end), terms in network.ends.items():
        if end in network.plant.modules[module].type.read:
            upstream.setdefault(module, set()).update(known.module for _, known in terms)
    for (module, _), signals in network.gathers.items():
        upstream.setdefault(module, set()).update(m for m, _ in signals)
    mapped = {column.signal for column in network.plant.columns}
    waiting = [
        module.name
        for module in network.plant.modules.values()
        if any(not mapped or f"{module.name}.{name}" in mapped for name in module.type.readings)
    ]
    seen: set[str] = set()
    while waiting:
        module = waiting.pop()
        if module not in seen:
            seen.add(module)
            waiting += upstream.get(module, ())
    return seen
