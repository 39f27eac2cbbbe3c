"""Pass 6, assemble: combine the differentiated types into the equations of the plant.

Each module instance is lowered to nodes of one graph. A *gradient* here maps each independent input
(a reading, a whitened parameter, a misfit) to a node: the derivative times the standard uncertainty
of that input. Covariances are then plain sums of products, and two estimates that share a sensor
are correlated by construction.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import sympy
from rulec_runtime.contract.ruleset import FORM, MISFIT

from rulec.algebra.derivative import derivative
from rulec.algebra.graph import Graph, Node
from rulec.algebra.recipe import lower, lower_all
from rulec.knowledge.plant import Module
from rulec.passes.corrected_observers import liquid_affects, undo_graph
from rulec.passes.derive_residuals import Residual
from rulec.passes.differentiate import GATHERED, TypeFault, TypeModel
from rulec.passes.limits import FORM_COMMON
from rulec.passes.link import Network

Gradient = Mapping[str, Node]

PARAMETERS = "u:parameters"
MODEL = "u:model"


@dataclass(frozen=True, kw_only=True)
class TargetNodes:
    """The target that a fault scales, and the observers it reaches (see `Target`).

    `reaction` is the slope of the module's true flow by the target.
    """

    value: Node
    gradient: Gradient
    slopes: Mapping[str, Node]
    slope_gradients: Mapping[str, Gradient]
    curvatures: Mapping[str, Node]
    inverse: Mapping[str, tuple[sympy.Expr, Mapping[sympy.Symbol, Node]]]
    whole: Node
    whole_gradient: Gradient
    reaction: Node


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """A fault of a module instance.

    `affects` lists the ids of observers in the whole plant, `scales` the signals in its target.
    """

    id: str
    module: str
    fault: TypeFault
    target: str
    affects: tuple[str, ...]
    scales: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Assembly:
    """The equations of a plant as nodes of `graph`, keyed by ids such as ``A.pump``.

    `unlisted` are errors of readings that no module lists; no pass derives rules for them.
    `margins` are those of conditions of regimes, such as ``A.reverse-flow:0``, each with its
    standard uncertainty. `liquid` lists the observers that each change of the liquid makes wrong.
    """

    graph: Graph
    observers: Mapping[str, Node]
    gradients: Mapping[str, Gradient]
    guards: Mapping[str, tuple[tuple[str, Node], ...]]
    targets: Mapping[str, TargetNodes]
    hypotheses: tuple[Hypothesis, ...]
    unlisted: tuple[Hypothesis, ...]
    residual_nodes: Mapping[str, Node]
    residual_gradients: Mapping[str, Gradient]
    residual_variances: Mapping[str, Node]
    margins: Mapping[str, tuple[Node, Node]]
    undo: Graph
    liquid: Mapping[str, tuple[str, ...]]


def assemble(
    network: Network, residuals: tuple[Residual, ...], types: Mapping[str, TypeModel]
) -> Assembly:
    """Lower all modules of the plant into one graph.

    >>> from rulec.passes.pipeline import example
    >>> assembly = example("assembly").assembly
    >>> list(assembly.observers)
    ['A.pump', 'A.power', 'A.plant', 'B.pump', 'B.power', 'B.plant', 'C.resis']
    >>> [h.affects for h in assembly.hypotheses if h.id == "A.leakage"]
    [('A.pump', 'A.power')]
    """
    plant = network.plant
    signals = plant.signals
    graph = Graph([*signals, *(f"u:{s}" for s in signals), PARAMETERS, MODEL])
    parts = {m.name: _Instance(m, network, types, graph) for m in plant.modules.values()}
    observers: dict[str, Node] = {}
    gradients: dict[str, Gradient] = {}
    guards: dict[str, tuple[tuple[str, Node], ...]] = {}
    for part in parts.values():
        part.lower_observers(observers, gradients, guards)
    readers = _readers(parts.values())
    hypotheses: list[Hypothesis] = []
    unlisted: list[Hypothesis] = []
    for part in parts.values():
        hypotheses += _hypotheses(part, part.model.faults, readers)
        unlisted += _hypotheses(part, part.model.unlisted, readers)
    targets: dict[str, TargetNodes] = {}
    for part in parts.values():
        part.lower_targets(targets)
    _add_readers(parts, readers, targets)
    _react(parts, readers, targets)
    nodes, residual_gradients, variances = _residual_nodes(graph, residuals, observers, gradients)
    return Assembly(
        graph=graph,
        observers=observers,
        gradients=gradients,
        guards=guards,
        targets=targets,
        hypotheses=tuple(hypotheses),
        unlisted=tuple(h for h in unlisted if h.affects),
        residual_nodes=nodes,
        residual_gradients=residual_gradients,
        residual_variances=variances,
        margins={name: m for part in parts.values() for name, m in part.margins()},
        undo=undo_graph(network, types, tuple(h.id for h in hypotheses)),
        liquid=liquid_affects(network, types),
    )


class _Instance:
    """Lowers one module; holds the tables that lowering needs."""

    def __init__(
        self, module: Module, network: Network, types: Mapping[str, TypeModel], graph: Graph
    ) -> None:
        self.module, self.graph = module, graph
        self.model: TypeModel = types[module.type.key]
        self.gathers = {
            name: tuple(f"{m}.{s}" for m, s in network.gathers[module.name, name])
            for name in module.type.gathers
        }
        symbols = self.model.symbols
        self.nodes = {symbols[s]: graph.input(self.id(s)) for s in module.type.signals}
        for name, parameter in module.parameters.items():
            self.nodes[symbols[name]] = graph.constant(parameter.value)
        for name, signals in self.gathers.items():
            self.nodes[symbols[GATHERED + name]] = graph.sum(graph.input(s) for s in signals)
        self._blocks = {p: b for b in module.blocks for p in b.parameters}

    def id(self, name: str) -> str:
        return f"{self.module.name}.{name}"

    def lower(self, expression: sympy.Expr) -> Node:
        return lower(self.graph, expression, self.nodes)

    def gradient(self, expression: sympy.Expr) -> dict[str, Node]:
        """Derivatives of an expression by independent inputs, times u."""
        graph, kind = self.graph, self.module.type
        derivatives = self.model.gradient(expression)
        nodes = lower_all(graph, derivatives.values(), self.nodes)
        lowered = dict(zip(derivatives, nodes, strict=True))
        result: dict[str, Node] = {}

        def contribute(name: str, node: Node) -> None:
            result[name] = graph.add(result.get(name, graph.zero), node)

        for name, node in lowered.items():
            if name in kind.signals:
                signal = self.id(name)
                contribute(signal, graph.mul(node, graph.input(f"u:{signal}")))
            elif name.startswith(GATHERED):
                for signal in self.gathers[name.removeprefix(GATHERED)]:
                    contribute(signal, graph.mul(node, graph.input(f"u:{signal}")))
            elif name not in self._blocks and self.module.parameters[name].u:
                parameter = self.module.parameters[name]
                u = graph.mul(graph.constant(parameter.u), graph.input(PARAMETERS))
                contribute(name if parameter.shared else self.id(name), graph.mul(node, u))
        # Correlated parameters become independent ones by the factor of their block.
        for index, block in enumerate(self.module.blocks):
            for j in range(len(block.parameters)):
                terms = [
                    graph.mul(lowered[p], graph.constant(block.factor[i][j]))
                    for i, p in enumerate(block.parameters)
                    if p in lowered and block.factor[i][j]
                ]
                if terms:
                    node = graph.mul(graph.sum(terms), graph.input(PARAMETERS))
                    contribute(f"{self.module.name}#{index}.{j}", node)
        return {name: node for name, node in result.items() if not graph.is_zero(node)}

    def lower_observers(
        self,
        observers: dict[str, Node],
        gradients: dict[str, Gradient],
        guards: dict[str, tuple[tuple[str, Node], ...]],
    ) -> None:
        for name, expression in self.model.observers.items():
            key = self.id(name)
            observers[key] = self.lower(expression)
            gradient = self.gradient(expression)
            misfit = self.module.misfit.get(name)
            if misfit is not None:
                gradient |= self._of_model(f"{key}{MISFIT}", self.graph.constant(misfit), 1.0)
            else:
                # Nobody calibrated it: its laws are as accurate as their author says.
                for law, form in self.model.forms[name].items():
                    whole, own = self.lower(form), f"{self.id(law)}{FORM}"
                    gradient |= self._of_model(own, whole, FORM_COMMON)
                    gradient |= self._of_model(f"{own}{MISFIT}", whole, 1.0 - FORM_COMMON)
            gradients[key] = gradient
            guards[key] = tuple((text, self.lower(e)) for text, e in self.model.guards[name])

    def _of_model(self, error: str, u: Node, share: float) -> dict[str, Node]:
        """An error of a law whose variance is a `share` of u squared, as part of a gradient."""
        node = self.graph.mul(self.graph.constant(share**0.5), u)
        node = self.graph.mul(node, self.graph.input(MODEL))
        return {} if self.graph.is_zero(node) else {error: node}

    def lower_targets(self, targets: dict[str, TargetNodes]) -> None:
        for name, target in self.model.targets.items():
            targets[self.id(name)] = TargetNodes(
                value=self.lower(target.value),
                gradient=self.gradient(target.value),
                slopes={self.id(o): self.lower(e) for o, e in target.slopes.items()},
                slope_gradients={self.id(o): self.gradient(e) for o, e in target.slopes.items()},
                curvatures={self.id(o): self.lower(e) for o, e in target.curvatures.items()},
                inverse={self.id(o): (e, self.nodes) for o, e in target.inverse.items()},
                whole=self.lower(target.whole),
                whole_gradient=self.gradient(target.whole),
                reaction=self.graph.zero,
            )

    def margins(self) -> Iterable[tuple[str, tuple[Node, Node]]]:
        """The margin that must be positive in each regime, and its standard uncertainty."""
        for name, value in self.model.margins.items():
            squares = [self.graph.square(node) for node in self.gradient(value).values()]
            u = self.graph.apply("sqrt", self.graph.sum(squares))
            yield self.id(name), (self.lower(value), u)

    def signals_of(self, target: str) -> tuple[str, ...]:
        """Signals in a target; none if its faults act on the flow."""
        found: list[str] = []
        value = self.model.targets[target].value if target in self.model.targets else sympy.S.Zero
        for name in self.model.gradient(value):
            if name in self.module.type.signals:
                found.append(self.id(name))
            elif name.startswith(GATHERED):
                found += self.gathers[name.removeprefix(GATHERED)]
        return tuple(found)

    def slope(self, observer: str, variable: str) -> Node:
        """Derivative of an own observer by a local variable, without uncertainty."""
        expression = self.model.gradients[observer].get(variable)
        return self.graph.zero if expression is None else self.lower(expression)

    def flow_response(self, target: str, signal: str) -> Node | None:
        """Slope of the flow by `signal`, along a component that a target does not affect.

        None if no such component's primary observer reads the signal.
        """
        distorted = self.model.targets[target].slopes
        for names in self.module.type.components().values():
            if names[0] not in distorted and signal in self.model.gradients[names[0]]:
                return self.slope(names[0], signal)
        return None

    def back_pressure_response(self, gathered: str) -> Node:
        """Slope of the flow by a pressure downstream, with two components in series.

        The primary observers of both components hold; their common signal adapts. The slope is the
        same for every module downstream.
        """
        graph, variable = self.graph, GATHERED + gathered
        primaries = [names[0] for names in self.module.type.components().values()]
        for line in primaries:
            if variable not in self.model.gradients[line]:
                continue
            for other in primaries:
                shared = [
                    s
                    for s, signal in self.module.type.signals.items()
                    if s in self.model.gradients[other]
                    and s in self.model.gradients[line]
                    and not signal.is_input
                ]
                if other != line and shared:
                    along = self.slope(other, shared[0])
                    across = self.slope(line, shared[0])
                    down = self.slope(line, variable)
                    return graph.div(graph.mul(along, down), graph.sub(along, across))
        return graph.zero


@dataclass(frozen=True)
class _Reader:
    """An observer that reads signals of other modules under the name `gathered`."""

    part: _Instance
    gathered: str
    observer: str

    @property
    def id(self) -> str:
        return self.part.id(self.observer)

    @cached_property
    def slope(self) -> tuple[Node, Gradient, Node]:
        """Slope by the downstream sum, its gradient and its curvature; the same for all signals."""
        variable, model = GATHERED + self.gathered, self.part.model
        expression = model.gradients[self.observer][variable]
        gradient = self.part.gradient(expression)
        curvature = derivative(expression, model.symbols[variable])
        return self.part.lower(expression), gradient, self.part.lower(curvature)


Readers = Mapping[str, list[_Reader]]
"""Observers of other modules, by the signal that they read through `downstream`."""


def _readers(parts: Iterable[_Instance]) -> Readers:
    found: dict[str, list[_Reader]] = {}
    for part in parts:
        for name, signals in part.gathers.items():
            reading = [
                _Reader(part, name, observer)
                for observer, gradient in part.model.gradients.items()
                if GATHERED + name in gradient
            ]
            for signal in signals:
                found.setdefault(signal, []).extend(reading)
    return found


def _hypotheses(
    part: _Instance, faults: Iterable[TypeFault], readers: Readers
) -> Iterable[Hypothesis]:
    for fault in faults:
        affects = [part.id(o) for o in fault.affects]
        if fault.fault.acts_on == "signal":
            affects += [reader.id for reader in readers.get(part.id(fault.target), ())]
        yield Hypothesis(
            id=part.id(fault.id),
            module=part.module.name,
            fault=fault,
            target=part.id(fault.target),
            affects=tuple(affects),
            scales=part.signals_of(fault.target),
        )


def _add_readers(
    parts: Mapping[str, _Instance], readers: Readers, targets: dict[str, TargetNodes]
) -> None:
    """Add the slopes of observers in other modules that read a faulty signal."""
    for part in parts.values():
        for name in part.model.targets:
            if name not in part.module.type.signals:
                continue
            key = part.id(name)
            old = targets[key]
            slopes, gradients = dict(old.slopes), dict(old.slope_gradients)
            curvatures = dict(old.curvatures)
            for reader in readers.get(key, ()):
                slopes[reader.id], gradients[reader.id], curvatures[reader.id] = reader.slope
            targets[key] = replace(
                old, slopes=slopes, slope_gradients=gradients, curvatures=curvatures
            )


def _react(
    parts: Mapping[str, _Instance], readers: Readers, targets: dict[str, TargetNodes]
) -> None:
    """Fill in the reaction of a module's true flow to a shift of a definition (paper form).

    A dosing module moves along its pump curve; a mixer moves all modules upstream.
    """
    for part in parts.values():
        graph = part.graph
        for name, target in part.model.targets.items():
            if name in part.module.type.signals or target.driver is None:
                continue
            reaction = part.flow_response(name, target.driver)
            if reaction is None:
                reading = readers.get(part.id(target.driver), ())
                upstream = dict.fromkeys((reader.part, reader.gathered) for reader in reading)
                reaction = graph.sum(other.back_pressure_response(n) for other, n in upstream)
            targets[part.id(name)] = replace(targets[part.id(name)], reaction=reaction)


def _residual_nodes(
    graph: Graph,
    residuals: Iterable[Residual],
    observers: Mapping[str, Node],
    gradients: Mapping[str, Gradient],
) -> tuple[dict[str, Node], dict[str, Gradient], dict[str, Node]]:
    """Residuals, their gradients and variances."""
    nodes: dict[str, Node] = {}
    tables: dict[str, Gradient] = {}
    variances: dict[str, Node] = {}
    for residual in residuals:
        nodes[residual.id] = graph.signed_sum((s, observers[o]) for s, o in residual.terms)
        table = combine(graph, [(s, gradients[o]) for s, o in residual.terms])
        tables[residual.id] = table
        variances[residual.id] = graph.sum(graph.square(node) for node in table.values())
    return nodes, tables, variances


def combine(graph: Graph, parts: Iterable[tuple[int, Gradient]]) -> dict[str, Node]:
    """Signed sum of gradients."""
    terms: dict[str, list[tuple[int, Node]]] = {}
    for sign, gradient in parts:
        for name, node in gradient.items():
            terms.setdefault(name, []).append((sign, node))
    return {name: graph.signed_sum(nodes) for name, nodes in terms.items()}


def covariance(graph: Graph, a: Gradient, b: Gradient) -> Node:
    """Covariance of two quantities from their gradients."""
    return graph.sum(graph.mul(a[name], b[name]) for name in a if name in b)
