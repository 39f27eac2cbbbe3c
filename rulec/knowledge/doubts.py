"""Doubts: values of a far wrong size, modules without connections or checks, laws without accuracy.

Doubts are not mistakes: a plant that has some still compiles. `rulec check` reports them.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import combinations, product

import numpy as np

from rulec.knowledge.knowledge import Knowledge
from rulec.knowledge.limits import (
    ALIKE_ESTIMATES,
    FAR_ESTIMATES,
    MISREAD_FACTORS,
    MOST_INSTRUMENTS,
    SAME_LAW,
    SAME_LAW_DRAWS,
)
from rulec.knowledge.module_type import ENDS, ModuleType, Observer, Parameter, Signal
from rulec.knowledge.plant import Plant
from rulec.knowledge.values_at import values_at
from rulec.language.diagnostics import Diagnostic
from rulec.language.read_yaml import Document, Path_
from rulec.language.units import PROPERTIES
from rulec.limits import ASSUMED_ACCURACY

Values = Mapping[str, float]


def doubts_of_types(documents: Iterable[Document], knowledge: Knowledge) -> Iterator[Diagnostic]:
    """Doubts about the module types in some files."""
    for document in documents:
        kind = knowledge.modules[document.data["module"]]
        reference = {s.name: s.reference for s in kind.signals.values() if s.reference is not None}
        for name in reference:
            yield from _outside(document, ("signals", name, "reference"), kind.signals[name])
        for name, message, hint in _far_estimates(kind, kind.parameters, reference):
            place = document.key("parameters", name) if name else document.key("observers")
            yield Diagnostic(place, "KB140", message, hint, doubt=True)
        for name, message, hint in _no_flows(kind, kind.parameters, reference):
            place = document.key("observers", name)
            yield Diagnostic(place, "KB140", message, hint, doubt=True)
        for path in (path for path, accuracy in kind.laws().items() if accuracy is None):
            assumed = f"{100 * ASSUMED_ACCURACY:g} %"
            message = f"law '{path[-1]}' states no accuracy; {assumed} is assumed"
            hint = f'add accuracy: "{assumed}, SOURCE", or what is known of it'
            yield Diagnostic(document.key(*path), "KB143", message, hint, doubt=True)
        for one, other in _same_laws(kind, reference):
            message = f"'{other}' is the same law as '{one}': both always agree, whatever happens"
            hint = "leave one out, or let it read another sensor"
            yield Diagnostic(document.key("observers", other), "KB147", message, hint, doubt=True)
        for name in unread(kind):
            message = f"no estimate reads '{name}': nothing ever shows its faults"
            hint = "read it in an equation, or leave its faults out"
            group = "signals" if name in kind.signals else "definitions"
            yield Diagnostic(document.key(group, name), "KB145", message, hint, doubt=True)


def doubts_of_plant(document: Document, plant: Plant) -> Iterator[Diagnostic]:
    """Doubts about what the plant file itself states."""
    for name, module in plant.modules.items():
        stated = document.data["modules"][name]
        for signal in stated.get("reference", {}):
            path = ("modules", name, "reference", signal)
            yield from _outside(document, path, module.type.signals[signal])
        if not ({"parameters", "reference"} & stated.keys() or module.type.fluid):
            continue  # any doubt is then about the type
        far = _far_estimates(module.type, module.stated, module.reference)
        for parameter, message, hint in far:
            path = ("modules", name, "parameters", parameter)
            place = document.key(*path) if path in document.keys else document.key(*path[:2])
            yield Diagnostic(place, "KB140", message, hint, doubt=True)
        for _, message, hint in _no_flows(module.type, module.stated, module.reference):
            yield Diagnostic(document.key("modules", name), "KB140", message, hint, doubt=True)
    touched = {name for connection in plant.connections for name in connection}
    for name in plant.modules if touched else ():
        if name not in touched:
            message = f"'{name}' is connected to no other module, though others are"
            hint = "add it to the connections, if it belongs there"
            yield Diagnostic(document.key("modules", name), "KB141", message, hint, doubt=True)


def doubts_of_redundancy(
    document: Document, plant: Plant, unchecked: Iterable[str], types: Iterable[ModuleType]
) -> Iterator[Diagnostic]:
    """Modules whose only estimate nothing in the plant checks; `types` show what could."""
    every = tuple(types)
    for name in unchecked:
        kind = plant.modules[name].type
        message = f"'{name}' estimates its flow in one way, and no neighbour in another"
        needed = " or ".join(instruments(kind, every))
        hint = f"none of its faults shows; type '{kind.name}' would need a reading of {needed}"
        if not needed:
            hint = "none of its faults shows; connect it to what it feeds, or add a flow meter"
        yield Diagnostic(document.key("modules", name), "KB144", message, hint, doubt=True)


def doubts_of_columns(
    document: Document, plant: Plant, same_flow: Callable[[str], Iterable[str]]
) -> Iterator[Diagnostic]:
    """Columns that several modules of one flow read, where one would do, or in laws.

    `same_flow` lists the modules whose flow is that of another by continuity. A module reads a
    meter for nothing else if only reference observers use it.
    """
    readers: dict[str, list[tuple[str, str]]] = {}
    for column in plant.columns:
        module, _, signal = column.signal.partition(".")
        readers.setdefault(column.column, []).append((module, signal))
    shared: list[tuple[str, str]] = []
    for title, several in readers.items():
        spare = [one for one in several if _only_reference(plant.modules[one[0]].type, one[1])]
        first = next((one for one in several if one not in spare), several[0])
        others = [one for one in spare if one != first and one[0] in same_flow(first[0])]
        laws = [one for one in several if one not in spare and one[1] in _used(plant, one[0])]
        if others:
            kept, given = ".".join(first), " and ".join(map(".".join, others))
            message = (
                f"'{title}' is {kept} and also {given}; rulec then finds no error of this meter"
            )
            hint = f"leave {given} out of the map: the flow follows from {first[0]}"
            yield Diagnostic(document.key("columns"), "KB146", message, hint, doubt=True)
        elif len(laws) > 1:
            shared.append((title, " and ".join(map(".".join, laws))))
    if shared:
        titles = " and ".join(f"'{title}'" for title, _ in shared)
        message = f"several laws read {titles}; rulec then finds no error of such a meter"
        hint = f"an error of '{shared[0][0]}' is reported, if at all, as one of {shared[0][1]}"
        yield Diagnostic(document.key("columns"), "KB146", message, hint, doubt=True)


def _used(plant: Plant, module: str) -> set[str]:
    """What the estimates and the balances of a module read."""
    return plant.modules[module].type.reached("observers", "states", "readings")


def _only_reference(kind: ModuleType, signal: str) -> bool:
    """Whether reference observers use a signal, and nothing else does."""
    using = [o for o in kind.observers.values() if signal in kind.names_through(o.expression)]
    elsewhere = (
        kind.reached("states", "readings") | kind.readings.keys() | {*kind.provides.values()}
    )
    return bool(using) and all(o.is_reference for o in using) and signal not in elsewhere


def _outside(document: Document, path: Path_, signal: Signal) -> Iterator[Diagnostic]:
    """A typical reading, in the unit of the signal, outside the range of its sensor, or below the
    smallest at which the equations hold."""
    part = document.data
    for step in path:
        part = part[step]
    value, low, high, least = signal.unit.to_si(part), signal.lowest, signal.highest, signal.minimum
    shown, message = signal.unit.from_si, ""
    if low is not None and high is not None and not low <= value <= high:
        message = f"the typical reading {part:g} lies outside of the range of '{signal.name}'"
        hint = f"the range is {shown(low):g} to {shown(high):g} {signal.unit.text}"
        hint += f"; a plant with another sensor says 'signals: {{{signal.name}: {{range: ...}}}}'"
    elif least is not None and value < least:
        message = f"the typical reading {part:g} lies below the minimum of '{signal.name}'"
        hint = f"below {shown(least):g} {signal.unit.text} nothing is judged"
    if message:
        yield Diagnostic(document.place(*path), "KB142", message, hint, doubt=True)


def _far_estimates(
    kind: ModuleType, parameters: Mapping[str, Parameter], reference: Values
) -> Iterator[tuple[str, str, str]]:
    """Estimates of one flow that are far apart at the typical readings.

    Yields the parameter that may be to blame (or ""), the message, and the remedy.
    """
    values = {name: p.value for name, p in parameters.items()}
    found = _far_pair(_flows(kind, values, reference))
    if found is None:
        return
    first, second, times = found
    message = (
        f"at the typical readings '{first}' gives {times:.3g} times the flow of '{second}'; "
        "both should be the same"
    )
    for name, factor in product(values, MISREAD_FACTORS):
        changed = {**values, name: values[name] * factor}
        flows = _flows(kind, changed, reference)
        if values[name] and _far_pair(flows, ALIKE_ESTIMATES) is None and len(flows) > 1:
            p = parameters[name]
            hint = f"with {factor:g} times '{name}' they agree: is '{p.unit.text}' the right unit?"
            yield name, message, hint
            return
    yield "", message, "check the units of parameters, and the references of signals"


def doubts_of_balances(
    document: Document, plant: Plant, balances: Iterable[tuple[str, Iterable[tuple[int, str]]]]
) -> Iterator[Diagnostic]:
    """Flows of neighbours that are far apart at the typical readings, where all are stated.

    `balances` are modules with a signed sum of estimates, of several modules, that should be zero.
    """
    flows = {
        f"{name}.{observer}": flow
        for name, m in plant.modules.items()
        for observer, flow in _stated_flows(m.type, m.stated, m.reference).items()
    }
    told: set[str] = set()
    for name, terms in balances:
        signed = [(sign, o, flows.get(o, math.nan)) for sign, o in terms]
        sides = {
            " + ".join(o for sign, o, _ in signed if sign == side): abs(
                sum(flow for sign, _, flow in signed if sign == side)
            )
            for side in (1, -1)
        }
        far = _far_pair(sides)
        if far is not None and name not in told:
            told.add(name)
            message = f"at the typical readings {far[0]} is {far[2]:.3g} times {far[1]}"
            message += "; both should be the same flow"
            hint = "check whether these modules fit together, their units and references"
            yield Diagnostic(document.key("modules", name), "KB140", message, hint, doubt=True)


def _no_flows(
    kind: ModuleType, parameters: Mapping[str, Parameter], reference: Values
) -> Iterator[tuple[str, str, str]]:
    """Estimates that give no flow, or one backwards, at the typical readings, where all are stated.

    Yields the observer, the message, and the remedy.
    """
    for name, flow in _stated_flows(kind, parameters, reference).items():
        if not flow >= 0:
            fails = math.isnan(flow)
            what = "cannot be calculated" if fails else f"gives {3600 * flow:.3g} m3/h, backwards"
            why = "a root, logarithm or division fails there; " if fails else ""
            hint = f"{why}check signs, the units of parameters, and the references of signals"
            yield name, f"at the typical readings '{name}' {what}", hint


def _same_laws(kind: ModuleType, reference: Values) -> Iterator[tuple[str, str]]:
    """Pairs of observers that agree at any readings, parameters and properties of the liquid."""
    random, draws = np.random.default_rng(0), list[dict[str, float]]()
    for _ in range(SAME_LAW_DRAWS):
        given = {p.name: p.value or p.u or 1.0 for p in kind.parameters.values()}
        given |= {name: reference.get(name) or 1.0 for name in (*kind.signals, *PROPERTIES)}
        drawn = {name: value * random.uniform(0.9, 1.1) for name, value in given.items()}
        draws.append(values_at(kind, drawn))
    for one, other in combinations(kind.observers, 2):
        pairs = [(d.get(one, math.nan), d.get(other, math.nan)) for d in draws]
        if all(math.isclose(*pair, rel_tol=SAME_LAW) for pair in pairs):
            yield one, other


def _far_pair(flows: Values, far: float = FAR_ESTIMATES) -> tuple[str, str, float] | None:
    """The first pair whose ratio exceeds `far`: the larger, the smaller, and the ratio."""
    for one, other in combinations(flows, 2):
        a, b = sorted((one, other), key=lambda name: -abs(flows[name]))
        if flows[b] and abs(flows[a] / flows[b]) > far:
            return a, b, abs(flows[a] / flows[b])
    return None


def _stated_flows(
    kind: ModuleType, parameters: Mapping[str, Parameter], reference: Values
) -> dict[str, float]:
    """Estimates at the typical readings, SI, of those whose typical readings are all stated."""
    flows = _flows(kind, {name: p.value for name, p in parameters.items()}, reference)
    read = {o: kind.names_through(kind.observers[o].expression) & {*kind.signals} for o in flows}
    return {name: flow for name, flow in flows.items() if read[name] <= reference.keys()}


def _flows(kind: ModuleType, parameters: Values, reference: Values) -> dict[str, float]:
    """Estimates at the typical readings, SI; those that need other modules are left out."""
    given = {**parameters}
    for signal in kind.signals.values():
        value = reference.get(signal.name)
        if value is None and signal.lowest is not None and signal.highest is not None:
            value = (signal.lowest + signal.highest) / 2
        if value is not None:
            given[signal.name] = value
    values = values_at(kind, given)
    return {name: values[name] for name in kind.observers if name in values}


def instruments(kind: ModuleType, types: Iterable[ModuleType]) -> tuple[str, ...]:
    """What a further estimate would need: own signals that nothing reads, else usual quantities.

    Proposals come from other module types that can estimate the flow from the quantities read here
    and have a second estimate: the quantity which that one adds is proposed. Flow meters come
    first, as they always give an estimate, then the quantities that most types add.
    """
    own = _quantities(kind, kind.observers.values())
    counts: Counter[str] = Counter()
    flows: set[str] = set()
    for other in types:
        meters = {observer.expression.text for observer in other.observers.values()}
        flows |= {s.quantity for name, s in other.signals.items() if name in meters}
        each = [_quantities(other, [observer]) for observer in other.observers.values()]
        more = _quantities(other, other.observers.values()) - own
        if len(more) == 1 and any(quantities and quantities <= own for quantities in each):
            counts.update(more)
    others = sorted(counts.keys() - flows, key=lambda quantity: (-counts[quantity], quantity))
    usual = [*sorted(flows - own), *others]
    idle = {s.quantity: s.name for s in kind.signals.values() if s.name not in kind.read}
    declared = [f"{quantity} ('{idle[quantity]}')" for quantity in usual if quantity in idle]
    return tuple(declared or usual)[:MOST_INSTRUMENTS]


def unread(kind: ModuleType) -> Iterable[str]:
    """Signals and definitions with a fault that no estimate, state or reading uses."""
    reached = kind.reached("observers", "states", "readings") | kind.readings.keys() | {*ENDS}
    own = kind.signals.keys() | kind.definitions.keys()
    return sorted({use.target for use in kind.faults if use.target in own - reached})


def _quantities(kind: ModuleType, observers: Iterable[Observer]) -> set[str]:
    names = {name for part in observers for name in kind.names_through(part.expression)}
    return {signal.quantity for name, signal in kind.signals.items() if name in names}
