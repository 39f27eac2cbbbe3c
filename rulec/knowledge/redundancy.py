"""Which further instrument gives a module type a second way to estimate its flow.

What is proposed is read off the other module types: a type that also estimates the flow from what
this one reads, and has another estimate besides, shows which quantity that takes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from rulec.knowledge.module_type import ENDS, ModuleType, Observer
from rulec.language.units import VOLUME_FLOW
from rulec.limits import MOST_INSTRUMENTS


def instruments(kind: ModuleType, types: Iterable[ModuleType]) -> tuple[str, ...]:
    """What a further estimate would take: own signals that nothing reads, else usual quantities.

    A flow meter always gives one, so it stands first; then come the quantities that most types add
    to what this one reads.
    """
    own = _quantities(kind, kind.observers.values())
    counts: Counter[str] = Counter()
    flows: set[str] = set()
    for other in types:
        flows |= {s.quantity for s in other.signals.values() if s.unit.dimension == VOLUME_FLOW}
        each = [_quantities(other, [observer]) for observer in other.observers.values()]
        more = _quantities(other, other.observers.values()) - own
        if len(more) == 1 and any(known and known <= own for known in each):
            counts.update(more)
    others = sorted(counts.keys() - flows, key=lambda quantity: (-counts[quantity], quantity))
    usual = [*sorted(flows - own), *others]
    idle = {s.quantity: s.name for s in kind.signals.values() if s.name not in kind.read}
    declared = [f"{quantity} ('{idle[quantity]}')" for quantity in usual if quantity in idle]
    return tuple(declared or usual)[:MOST_INSTRUMENTS]


def unread(kind: ModuleType) -> Iterable[str]:
    """Signals and definitions with a fault that no estimate, state or reading stands on."""
    ends = [observer.expression for observer in kind.observers.values()]
    ends += [reading.expression for reading in kind.readings.values()]
    ends += [equation for state in kind.states.values() for _, equation in state.equations()]
    reached = {name for end in ends for name in kind.names_through(end)} | kind.readings.keys()
    for end in kind.definitions.keys() & {*ENDS}:
        reached |= {end} | kind.names_through(kind.definitions[end].expression)
    known = kind.signals.keys() | kind.definitions.keys()
    return sorted({use.target for use in kind.faults if use.target in known - reached})


def _quantities(kind: ModuleType, observers: Iterable[Observer]) -> set[str]:
    """Quantities of the signals that some estimates stand on."""
    names = {name for part in observers for name in kind.names_through(part.expression)}
    return {signal.quantity for name, signal in kind.signals.items() if name in names}
