"""Equations of modules directly to a plan: without sympy, with parameters as inputs.

The analysis of a mismatch refits the parameters of many variants of a module; each is lowered in
well under a millisecond. Tests check that the result agrees to the last digits with what the
compiler makes of the same equations through sympy.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from rulec_runtime.contract.plan import Plan

from rulec.algebra.graph import Graph, Node
from rulec.knowledge.fluid import factor_name
from rulec.knowledge.module_type import ENDS, Fluid
from rulec.knowledge.plant import Module
from rulec.language.expression import Expression, Rejected, fold
from rulec.language.units import PROPERTIES
from rulec.passes.amend import Amended
from rulec.passes.link import WAY, EndFlows, Network

Shifts = Mapping[tuple[str, str, str], str]
"""Plan inputs that shift places, by module, kind of place (as in `Change`) and name."""

Pending = frozenset[tuple[str, str]]
"""Parts that are being lowered: module and description."""


class _Names(Protocol):
    """The nodes of names in an equation."""

    def value(self, name: str) -> Node: ...

    def gathered(self, name: str) -> Node: ...

    def property(self, name: str, temperature: Node) -> Node: ...


def lower_tree(graph: Graph, tree: ast.expr, names: _Names) -> Node:
    """Build the node of an equation's tree."""

    def leaf(node: ast.expr) -> Node:
        match node:
            case ast.Constant(value=int(number) | float(number)):
                return graph.constant(number)
            case ast.Name(id=name):
                return names.value(name)
            case ast.Call(args=[ast.Name(id=name)]):
                return names.gathered(name)
        raise AssertionError(ast.dump(node))

    def operation(name: str, _: ast.expr, parts: list[Any]) -> Node:
        if name == "pow":
            return _power(graph, parts[0], float(parts[1]))
        if name in PROPERTIES:
            return names.property(name, parts[0])
        return graph.apply(name, *parts)

    return fold(tree, leaf, operation)


def _power(graph: Graph, base: Node, power: float) -> Node:
    if power < 0:
        return graph.div(graph.one, _power(graph, base, -power))
    whole, half = int(power), power - int(power) == 0.5
    if power != whole and not half:
        return graph.apply("pow", base, graph.constant(power))
    result = graph.apply("sqrt", base) if half else graph.one
    for _ in range(whole):
        result = graph.mul(result, base)
    return result


@dataclass(frozen=True)
class Lowering:
    """What is lowered: the amended types of some modules of a plant, with places shifted by inputs.

    Without `ends`, inflow and outflow of a module that stores are inputs of its plan.
    """

    network: Network
    amended: Mapping[str, Amended]
    shifts: Shifts = field(default_factory=dict)
    ends: EndFlows | None = None

    def of(self, module: str) -> Amended:
        """The type of a module with its changes."""
        return self.amended.get(module) or Amended(type=self.network.plant.modules[module].type)


def lower_module(what: Lowering, module: str, definitions: bool = False) -> Plan:
    """The observers of a module as a plan.

    Inputs are ids of signals and parameters (``A.k2``), and those of changes and shifts. Outputs
    are ``q:<observer>`` and ``guard:<observer>:<i>``; with `definitions` also ``d:<definition>``,
    ``der:<state>`` and ``shown:<reading>``.
    """
    graph = Graph(dict.fromkeys(_inputs(what, module)))
    scope, kind = _Scope(graph, what, module), what.of(module).type
    for observer in kind.observers.values():
        graph.outputs[f"q:{module}.{observer.name}"] = scope.observer(observer.name)
        equations = kind.with_definitions(observer.expression)
        for i, argument in enumerate(tree for e in equations for tree in e.guarded()):
            node = lower_tree(graph, argument, scope)
            graph.outputs[f"guard:{module}.{observer.name}:{i}"] = node
    if definitions:
        graph.outputs |= {f"d:{name}": scope.value(name) for name in kind.definitions}
        graph.outputs |= {f"der:{name}": scope.balance(name) for name in kind.states}
        graph.outputs |= {f"shown:{name}": scope.shown(name) for name in kind.readings}
    return graph.plan()


def lower_states(what: Lowering) -> Plan:
    """The balances of a whole plant as one plan.

    Inputs are ids of states (``A.h``), signals and parameters, and those of changes and shifts.
    Outputs are ``der:<state>``, ``start:<state>``, ``low:<state>`` and ``high:<state>`` if there
    are limits, ``after:<state>`` for a dead time, ``shown:<signal>`` for readings, and
    ``inflow:<module>``, ``outflow:<module>``, and ``law:<module>.<name>`` for places that `shifts`
    shift as a form (``form.<module>.<name>``).
    """
    modules = what.network.plant.modules
    graph = Graph(dict.fromkeys(name for m in modules for name in _inputs(what, m)))
    for module in modules:
        scope, kind = _Scope(graph, what, module), what.of(module).type
        for name, state in kind.states.items():
            for key, equation in state.equations():
                rate = key == "der"
                node = scope.balance(name) if rate else lower_tree(graph, equation.tree, scope)
                graph.outputs[f"{key}:{module}.{name}"] = node
        for name in kind.readings:
            graph.outputs[f"shown:{module}.{name}"] = scope.shown(name)
        ends = [e for e in ENDS if e in kind.definitions or (module, e) in (what.ends or {})]
        graph.outputs |= {f"{end}:{module}": scope.value(end) for end in ends}
    reached = graph.plan().used_inputs
    for (module, place, name), shift in what.shifts.items():
        if shift in reached and shift == form_of(module, name):
            scope = _Scope(graph, what, module)
            law = scope.observer if place == "observer" else scope.value
            graph.outputs[f"law:{module}.{name}"] = law(name)
    return graph.plan()


def parameter_id(module: Module, name: str) -> str:
    """Plan input of a parameter; the same for all modules if its error is shared."""
    return name if module.parameters[name].shared else f"{module.name}.{name}"


def form_of(module: str, law: str) -> str:
    """Plan input of what a law adds to its formula."""
    return f"form.{module}.{law}"


def _inputs(what: Lowering, module: str) -> Iterator[str]:
    """All inputs that the plan of a module may have."""
    network = what.network
    gathered = [network.gathers[module, name] for name in what.of(module).type.gathers]
    for name in dict.fromkeys([module, *(m for part in gathered for m, _ in part)]):
        instance, amended = network.plant.modules[name], what.of(name)
        yield from (f"{name}.{signal}" for signal in amended.type.signals)
        yield from (f"{name}.{state}" for state in amended.type.states)
        yield from (f"{name}.{end}" for end in ENDS if what.ends is None and amended.type.flows)
        yield from (parameter_id(instance, p) for p in instance.parameters)
        yield from amended.inputs.values()
        yield from amended.outside.values()
    yield from what.shifts.values()


class _Scope:
    """Names of one module and their nodes; a definition is lowered at its first use.

    `pending` are the flows and readings that are being lowered; a second request for one of them
    means that it depends on itself.
    """

    def __init__(
        self, graph: Graph, what: Lowering, module: str, pending: Pending = frozenset()
    ) -> None:
        self._graph, self._what, self._module, self._pending = graph, what, module, pending
        self._amended, self._instance = what.of(module), what.network.plant.modules[module]
        self._nodes: dict[str, Node] = {}

    def value(self, name: str) -> Node:
        if name not in self._nodes:
            self._nodes[name] = self._new(name)
        return self._nodes[name]

    def _new(self, name: str) -> Node:
        kind, graph = self._amended.type, self._graph
        if name in kind.signals:
            return self._shifted("signal", name, self._signal(name), graph.sub)
        if name in kind.definitions:
            node = lower_tree(graph, kind.definitions[name].expression.tree, self)
            return self._shifted("definition", name, node, graph.add)
        if name in kind.states:
            return graph.input(f"{self._module}.{name}")
        if name in ENDS and kind.flows:
            return self._shifted("end", name, self._end(name), graph.add)
        input_ = self._amended.inputs.get(name) or self._amended.outside.get(name)
        return graph.input(input_ or parameter_id(self._instance, name))

    def observer(self, name: str) -> Node:
        tree = self._amended.type.observers[name].expression.tree
        node = lower_tree(self._graph, tree, self)
        return self._shifted("observer", name, node, self._graph.add)

    def balance(self, name: str) -> Node:
        """The derivative of a state."""
        node = lower_tree(self._graph, self._amended.type.states[name].rate.tree, self)
        return self._shifted("balance", name, node, self._graph.add)

    def shown(self, name: str) -> Node:
        node = lower_tree(self._graph, self._amended.type.readings[name].expression.tree, self)
        return self._shifted("reading", name, node, self._graph.add)

    def _signal(self, name: str) -> Node:
        """A reading: an input, or in the balances of a whole plant what its sensor shows."""
        if self._what.ends is None or name not in self._amended.type.readings:
            return self._graph.input(f"{self._module}.{name}")
        return self._scope_of(self._module, f"what shows in '{name}' of").shown(name)

    def _end(self, end: str) -> Node:
        """The flow at an end without a law of its own."""
        if self._what.ends is None:
            return self._graph.input(f"{self._module}.{end}")
        terms = []
        for sign, source in self._what.ends[self._module, end]:
            other = self._scope_of(source.module, f"what flows {WAY[end]}")
            flow = other.observer if source.kind == "observer" else other.value
            terms.append((sign, flow(source.name)))
        return self._graph.signed_sum(terms)

    def _scope_of(self, module: str, what: str) -> _Scope:
        """The scope of a module that gives some part of this module."""
        if (self._module, what) in self._pending:
            message = f"{what} '{self._module}' depends on itself"
            raise Rejected("KB115", 0, message, "its law must not need that very value")
        pending = self._pending | {(self._module, what)}
        return _Scope(self._graph, self._what, module, pending)

    def _shifted(
        self, kind: str, name: str, node: Node, apply: Callable[[Node, Node], Node]
    ) -> Node:
        """The true value of a place: its value plus its error, but a reading minus its error."""
        shift = self._what.shifts.get((self._module, kind, name))
        return node if shift is None else apply(node, self._graph.input(shift))

    def gathered(self, name: str) -> Node:
        """The sum of readings downstream, corrected where possible."""
        nodes = []
        for module, signal in self._what.network.gathers[self._module, name]:
            other = _Scope(self._graph, self._what, module, self._pending)
            nodes.append(other.value(self._what.of(module).corrected.get(signal, signal)))
        return self._graph.sum(nodes)

    def property(self, name: str, temperature: Node) -> Node:
        """A property of the fluid, times its error factor.

        There is no factor if only an added law uses the property, which compares it with itself.
        """
        fluid = self._amended.type.fluid
        assert fluid is not None, "checked when the plant was read"
        form = _of_fluid(self._graph, fluid, temperature).value(name)
        factor = factor_name(fluid, name)
        if factor not in self._instance.parameters:
            return form
        return self._graph.mul(self.value(factor), form)


def lower_property(fluid: Fluid, name: str) -> Plan:
    """A property of a fluid as a plan with one output and the input ``T``."""
    graph = Graph({"T": None})
    graph.outputs[name] = _of_fluid(graph, fluid, graph.input("T")).value(name)
    return graph.plan()


def _of_fluid(graph: Graph, fluid: Fluid, temperature: Node) -> ClosedNames:
    equations = {n: part.expression for n, part in fluid.properties.items()}
    nodes = {"T": temperature, **{n: graph.constant(c) for n, c in fluid.coefficients.items()}}
    return ClosedNames(graph, {**fluid.definitions, **equations}, nodes)


@dataclass(frozen=True)
class ClosedNames:
    """Nodes of names in equations that ask neither other modules nor a fluid.

    Names of `equations` are lowered at their first use; those without one are inputs.
    """

    graph: Graph
    equations: Mapping[str, Expression]
    nodes: dict[str, Node] = field(default_factory=dict)

    def value(self, name: str) -> Node:
        if name not in self.nodes:
            part = self.equations.get(name)
            node = (
                self.graph.input(name) if part is None else lower_tree(self.graph, part.tree, self)
            )
            self.nodes[name] = node
        return self.nodes[name]

    def gathered(self, name: str) -> Node:
        raise AssertionError(name)

    def property(self, name: str, temperature: Node) -> Node:
        raise AssertionError(name)
