"""Places of a module where physics may be missing: definitions, observers, signals.

The equation alone characterises a place: its dimension, its readings, the observers that depend on
it, and its slopes at the reference point of the plant.
"""

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from rulec.algebra.tangent import run_with_slopes
from rulec.knowledge.check_dimensions import dimensions_of
from rulec.knowledge.module_type import ENDS, OUTFLOW, Definition, ModuleType, Observer
from rulec.knowledge.plant import Module, Plant
from rulec.language.dimension import dimension
from rulec.language.expression import Expression
from rulec.language.units import UNKNOWN, VOLUME_FLOW, Dimension
from rulec.passes.link import Network
from rulec.passes.lower import Lowering, lower_module, lower_states, parameter_id


@dataclass(frozen=True, kw_only=True)
class Site:
    """A place of a module instance.

    `kind` is as in `Change`. `reads` are the own signals and states that it depends on, `uses` the
    definitions, both also indirectly. At the reference point, `slopes` are its derivatives by own
    signals, `shares` the relative ones, `moves` the derivatives of own observers by it (for a
    signal: by the reading). `observers` lists the ids of all observers, states and readings that it
    affects, also in other modules. `measured`: it reads a signal of its own dimension. `quantity`
    is as declared for a state or a sensor.
    """

    kind: str
    name: str
    title: str
    dimension: Dimension
    reads: frozenset[str] = frozenset()
    uses: frozenset[str] = frozenset()
    slopes: Mapping[str, float] = field(default_factory=dict)
    shares: Mapping[str, float] = field(default_factory=dict)
    moves: Mapping[str, float] = field(default_factory=dict)
    observers: tuple[str, ...]
    measured: bool = False
    quantity: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """Kind and name: a definition and an observer may share a name."""
        return self.kind, self.name


@dataclass(frozen=True)
class Survey:
    """What the survey of a module needs from the whole plant.

    `inputs` are values of all signals and parameters at the reference point, SI, by plan input;
    `readers` lists by signal the observers of other modules that read it.
    """

    network: Network
    inputs: Mapping[str, float]
    readers: Mapping[str, tuple[str, ...]]


def survey(network: Network, readings: Mapping[str, float]) -> Survey:
    """Prepare the survey of modules; `readings` are at the reference point, SI."""
    inputs = {**parameter_values(network.plant), **readings}
    if network.stores:
        inputs |= _stored(network, inputs)
    return Survey(network, inputs, _readers(network))


def _stored(network: Network, inputs: Mapping[str, float]) -> dict[str, float]:
    """States at their start, and the flows there, by the inputs of a module's plan."""
    plan = lower_states(Lowering(network, {}, {}, network.ends))
    result = dict(inputs)
    for _ in network.plant.modules:
        values = plan.run({name: result.get(name, 0.0) for name in plan.inputs})
        for output, value in values.items():
            kind, _, name = output.partition(":")
            if kind == "start":
                result[name] = float(value[0])
            elif kind in ENDS:
                result[f"{name}.{kind}"] = float(value[0])
    return result


def sites_of(around: Survey, module: Module) -> tuple[Site, ...]:
    """All places of a module, definitions in order of use, then observers, then signals."""
    return tuple(_Surveyor(around, module).sites())


def parameter_values(plant: Plant) -> dict[str, float]:
    """Values of all parameters by their plan inputs, SI."""
    return {
        parameter_id(m, p.name): p.value
        for m in plant.modules.values()
        for p in m.parameters.values()
    }


class _Surveyor:
    def __init__(self, around: Survey, module: Module) -> None:
        self._around, self._module, self._kind = around, module, module.type
        self._dimensions = dimensions(around.network, module.type)
        self._values, self._slopes = _reference_of(around, module, around.inputs)
        # A calibration whose recordings could not separate parameters may reverse a law; then its
        # stated parameters count.
        stated = {parameter_id(module, p.name): p.value for p in module.stated.values()}
        if any(around.inputs[name] != value for name, value in stated.items()):
            own = _reference_of(around, module, {**around.inputs, **stated})
            if _is_turned(self._slopes, own[1]):
                self._values, self._slopes = own

    def sites(self) -> Iterator[Site]:
        kind = self._kind
        for definition in kind.definitions.values():
            yield self._site("definition", definition, definition.title)
        for observer in kind.observers.values():
            yield self._site("observer", observer, f"flow by the observer {observer.name}")
        for signal in kind.signals.values():
            readers = [o.name for o in kind.observers.values() if signal.name in self._names(o)]
            elsewhere = self._around.readers.get(f"{self._module.name}.{signal.name}", ())
            yield Site(
                kind="signal",
                name=signal.name,
                title=signal.quantity,
                dimension=signal.unit.dimension,
                moves={o: self._moved(o, signal.name) for o in readers},
                observers=tuple(dict.fromkeys([*self._ids(readers), *elsewhere])),
                measured=True,
                quantity=signal.quantity,
            )
        yield from self._moving()

    def _moving(self) -> Iterator[Site]:
        """Places of a module that stores: flows at the ends without a law, balances, sensors."""
        kind, module = self._kind, self._module.name

        def site(what: str, name: str, title: str, dimension: Dimension, quantity: str) -> Site:
            return Site(
                kind=what,
                name=name,
                title=title,
                dimension=dimension,
                observers=self._stored if what == "end" else (f"{module}.{name}",),
                quantity=quantity,
            )

        for end in ENDS if kind.flows else ():
            if end not in kind.definitions:
                title = f"what flows {end.removesuffix('flow')}"
                yield site("end", end, title, VOLUME_FLOW, "")
        for s in kind.states.values():
            yield site("balance", s.name, f"balance of {s.title}", s.unit.dimension, s.quantity)
        for name in kind.readings:
            shown = kind.signals[name]
            title = f"what {name} shows"
            yield site("reading", name, title, shown.unit.dimension, shown.quantity)

    @cached_property
    def _stored(self) -> tuple[str, ...]:
        return tuple(f"{self._module.name}.{s}" for s in self._kind.states)

    def _site(self, kind: str, part: Definition | Observer, title: str) -> Site:
        names, name, observers = self._names(part), part.name, self._kind.observers
        if kind == "observer":
            output, readers = f"q:{self._module.name}.{name}", [name]
        else:
            output = f"d:{name}"
            readers = [o.name for o in observers.values() if name in self._names(o)]
        own, slopes = self._dimensions[kind, name], self._slopes[output]
        read = [s for s in (*self._kind.signals, *self._kind.states) if s in names]
        return Site(
            kind=kind,
            name=name,
            title=title,
            dimension=own,
            reads=frozenset(read),
            uses=frozenset(names & self._kind.definitions.keys()),
            slopes={s: slopes[s] for s in read},
            shares={s: self._share(output, s) for s in read},
            moves={o: self._moved(o, f"shift:{kind}:{name}") for o in readers},
            observers=(*self._ids(readers), *self._moved_by(name)),
            measured=any(
                s.unit.dimension == own for s in self._kind.signals.values() if s.name in names
            ),
        )

    def _moved(self, observer: str, seed: str) -> float:
        """Slope of an own observer by a signal or by a shift of a place."""
        return self._slopes[f"q:{self._module.name}.{observer}"][seed]

    def _moved_by(self, definition: str) -> tuple[str, ...]:
        """States and readings that a definition affects; its outflow counts as its states."""
        kind, found = self._kind, list[str]()
        law = kind.definitions.get(OUTFLOW)
        if law is not None and definition in {OUTFLOW, *self._names(law)}:
            found += self._stored or (f"{self._module.name}.{OUTFLOW}",)
        for path, expression in kind.equations_at():
            if path[0] in ("states", "readings") and definition in kind.names_through(expression):
                found.append(f"{self._module.name}.{path[1]}")
        return tuple(dict.fromkeys(found))

    def _share(self, output: str, signal: str) -> float:
        """Relative change of a place per relative change of a signal; 0 if the place is zero."""
        value = self._values[output]
        reading = self._around.inputs.get(f"{self._module.name}.{signal}", 0.0)
        share = self._slopes[output][signal] * reading / value if value else 0.0
        return share if math.isfinite(share) else 0.0

    def _names(self, part: Definition | Observer) -> set[str]:
        return self._kind.names_through(part.expression)

    def _ids(self, observers: Iterable[str]) -> tuple[str, ...]:
        return tuple(f"{self._module.name}.{o}" for o in observers)


def dimensions(network: Network, kind: ModuleType) -> dict[tuple[str, str], Dimension]:
    """Dimensions of definitions and observers, by kind of place and name."""
    gathered = {name: _provided(network, name) for name in kind.gathers}
    own = dimensions_of(kind, gathered)
    result = {("definition", name): own[name] for name in kind.definitions}
    for observer in kind.observers.values():
        result["observer", observer.name] = dimension(observer.expression, own, gathered)
    return result


def _provided(network: Network, name: str) -> Dimension:
    plant = network.plant
    for kind in (*(m.type for m in plant.modules.values()), *plant.knowledge.modules.values()):
        if name in kind.provides:
            return kind.signals[kind.provides[name]].unit.dimension
    return UNKNOWN


def _readers(network: Network) -> dict[str, tuple[str, ...]]:
    """The observers of other modules that read a signal through `downstream`, by signal."""
    found: dict[str, dict[str, None]] = {}
    for (reader, name), signals in network.gathers.items():
        kind = network.plant.modules[reader].type
        asking = [o.name for o in kind.observers.values() if _asks(kind, o.expression, name)]
        for owner, signal in signals:
            readers = found.setdefault(f"{owner}.{signal}", {})
            readers.update(dict.fromkeys(f"{reader}.{o}" for o in asking))
    return {signal: tuple(observers) for signal, observers in found.items()}


def _asks(kind: ModuleType, expression: Expression, name: str) -> bool:
    parts = kind.with_definitions(expression)
    return any(name == gathered for part in parts for gathered, _ in part.gathered())


_Slopes = Mapping[str, Mapping[str, float]]
"""Slopes of outputs by inputs; 0 where an output does not depend on one."""


def _is_turned(slopes: _Slopes, stated: _Slopes) -> bool:
    """Has any slope the other sign?"""
    return any(
        slope * stated[to][by] < 0.0 for to, own in slopes.items() for by, slope in own.items()
    )


def _reference_of(
    around: Survey, module: Module, readings: Mapping[str, float]
) -> tuple[dict[str, float], _Slopes]:
    """Definitions and observers, and their derivatives by own signals and errors of all places."""
    kind = module.type
    places = [("definition", n) for n in kind.definitions] + [
        ("observer", n) for n in kind.observers
    ]
    shifts = {(module.name, *place): "shift:{}:{}".format(*place) for place in places}
    plan = lower_module(Lowering(around.network, {}, shifts), module.name, definitions=True)
    inputs = {name: readings.get(name, 0.0) for name in plan.inputs}
    signals = {f"{module.name}.{s}": s for s in (*kind.signals, *kind.states)}
    values, slopes = run_with_slopes(plan, inputs, [*signals, *shifts.values()])
    return {name: float(v) for name, v in values.items()}, {
        output: defaultdict(float, {signals.get(seed, seed): float(v) for seed, v in by.items()})
        for output, by in slopes.items()
    }
