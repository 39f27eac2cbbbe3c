"""Pass 8, derive rules: from a residual to a fault degree, with uncertainty.

All rules have the same structure. `g` is the target that the fault scales, and `mu` = dR/dg. The
residual gives the excess of g, ``D = R/mu``, and the law of the fault gives the degree from g and
D. The forms differ in mu or D:

linear : slope at the measured point, at the same flow (default).
paper : slope that includes the reaction of the true flow (Eq. 16 of the seed paper).
exact : D from the observer solved for g, without linearisation; if only one observer is wrong.

For leakage and power readings, the linear rule is already exact.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import sympy

from rulec.algebra.graph import Graph, Node
from rulec.algebra.recipe import lower
from rulec.language.write_yaml import signed_sum
from rulec.passes.assemble import Assembly, Gradient, Hypothesis, combine, covariance
from rulec.passes.derive_residuals import Residual
from rulec.passes.derive_signatures import Signature, Signatures, most_telling
from rulec.passes.differentiate import EXCESS, FLOW, G
from rulec.passes.limits import LONG_SUM, MANY_CORRELATED


@dataclass(frozen=True)
class Rule:
    """The forms of a cell's rule in the plan, and the rule as readable text."""

    signature: Signature
    forms: tuple[str, ...]
    equation: str


def derive_rules(
    residuals: tuple[Residual, ...], assembly: Assembly, signatures: Signatures
) -> tuple[Rule, ...]:
    """Add observers, residuals, gradients, guards and all rules to the outputs of the graph.

    >>> from rulec.passes.pipeline import example
    >>> example("rules").rules[0].equation
    'x = R/A.pump, R = A.pump-plant'
    """
    _basic_outputs(assembly)
    hypotheses = {h.id: h for h in assembly.hypotheses}
    moments = Moments(residuals, assembly)
    spreads: dict[tuple[str, str, str], _Spread] = {}
    return tuple(
        _rule(assembly, moments, spreads, hypotheses[c.fault], c)
        for c in most_telling(signatures.cells)
    )


def _basic_outputs(assembly: Assembly) -> None:
    """``q:``, ``s:`` (scaled gradient), ``guard:``, ``R:`` and ``u:`` outputs, and margins."""
    graph, outputs = assembly.graph, assembly.graph.outputs
    for observer, node in assembly.observers.items():
        outputs[f"q:{observer}"] = node
        for i, (_, guard) in enumerate(assembly.guards[observer]):
            outputs[f"guard:{observer}:{i}"] = guard
        for name, scaled in assembly.gradients[observer].items():
            outputs[f"s:{observer}:{name}"] = scaled
    for residual, node in assembly.residual_nodes.items():
        outputs[f"R:{residual}"] = node
        outputs[f"u:{residual}"] = graph.apply("sqrt", assembly.residual_variances[residual])
    for name, (margin, u) in assembly.margins.items():
        outputs[f"margin:{name}"], outputs[f"u_margin:{name}"] = margin, u


def _rule(
    assembly: Assembly,
    moments: Moments,
    spreads: dict[tuple[str, str, str], _Spread],
    hypothesis: Hypothesis,
    cell: Signature,
) -> Rule:
    graph, outputs = assembly.graph, assembly.graph.outputs
    key = f"{cell.fault}:{cell.residual}"
    R = assembly.residual_nodes[cell.residual]
    degree = hypothesis.fault.rule.degree

    def rule(form: str, mu: Node, scaled: Node, gradients: Signed) -> None:
        at = {G: scaled, EXCESS: graph.div(R, mu)}
        # Two directions of one fault scale the same g and so share their second moments.
        place = (hypothesis.target, cell.residual, form)
        spread = spreads.get(place)
        if spread is None:
            spread = spreads[place] = _spread(assembly, moments, hypothesis, cell, gradients)
        outputs[f"x:{form}:{key}"] = lower(graph, degree, at)
        outputs[f"ux:{form}:{key}"] = _uncertainty(graph, hypothesis, spread, mu, at)

    rule("linear", cell.slope, cell.scaled, _scaled_gradients(assembly, hypothesis, cell))
    forms = ["linear"]
    if hypothesis.fault.fault.acts_on == "definition":
        target = assembly.targets[hypothesis.target]
        count = sum(sign for sign, _ in cell.faulty)
        reaction = graph.mul(graph.constant(count), target.reaction)
        mu = graph.sub(cell.slope, reaction)
        rule("paper", mu, target.whole, [(1, target.whole_gradient)])
        forms.append("paper")
    exact = _exact_excess(assembly, hypothesis, cell, R)
    if exact is not None:
        outputs[f"x:exact:{key}"] = lower(graph, degree, {G: cell.scaled, EXCESS: exact})
        forms.append("exact")
    return Rule(cell, tuple(forms), _text(hypothesis, cell))


def _exact_excess(
    assembly: Assembly, hypothesis: Hypothesis, cell: Signature, R: Node
) -> Node | None:
    """g minus the g at which the residual vanishes; None if several observers depend on it."""
    if hypothesis.fault.fault.acts_on == "flow" or len(cell.faulty) != 1:
        return None
    (sign, observer), graph = cell.faulty[0], assembly.graph
    solved = assembly.targets[hypothesis.target].inverse.get(observer)
    if solved is None:
        return None
    expression, nodes = solved
    should = graph.signed_sum([(1, assembly.observers[observer]), (-sign, R)])
    flow = sympy.Symbol(FLOW, real=True)
    return graph.sub(cell.scaled, lower(graph, expression, {**nodes, flow: should}))


@dataclass(frozen=True, kw_only=True)
class _Spread:
    """Variances and doubled covariances of R, g and mu, and dmu/dg."""

    residual: Node
    scaled: Node
    residual_scaled: Node
    slope: Node
    residual_slope: Node
    scaled_slope: Node
    curvature: Node


def _scaled_gradients(assembly: Assembly, hypothesis: Hypothesis, cell: Signature) -> Signed:
    """Gradients whose signed sum is that of g."""
    if hypothesis.fault.fault.acts_on == "flow":
        return [(s, assembly.gradients[o]) for s, o in cell.faulty]
    return [(1, assembly.targets[hypothesis.target].gradient)]


def _spread(
    assembly: Assembly, moments: Moments, hypothesis: Hypothesis, cell: Signature, scaled: Signed
) -> _Spread:
    graph, targets, name = assembly.graph, assembly.targets, hypothesis.target
    # The slope of a flow fault is exactly 1: it has neither uncertainty nor curvature.
    uncertain = () if hypothesis.fault.fault.acts_on == "flow" else cell.faulty

    def twice(node: Node) -> Node:
        return graph.mul(graph.constant(2.0), node)

    scaled = moments.gathered(scaled)
    own = moments.between(scaled, scaled)
    residual_scaled = twice(moments.with_residual(cell.residual, scaled))
    slope = moments.gathered([(s, targets[name].slope_gradients[o]) for s, o in uncertain])
    return _Spread(
        residual=assembly.residual_variances[cell.residual],
        scaled=own,
        residual_scaled=residual_scaled,
        slope=moments.between(slope, slope),
        residual_slope=twice(moments.with_residual(cell.residual, slope)),
        scaled_slope=twice(moments.between(scaled, slope)),
        curvature=graph.signed_sum((s, targets[name].curvatures[o]) for s, o in uncertain),
    )


def _uncertainty(
    graph: Graph, hypothesis: Hypothesis, spread: _Spread, mu: Node, at: Mapping[sympy.Symbol, Node]
) -> Node:
    """Standard uncertainty of a degree: first order in R, g and mu with all correlations.

    For the degree X(g, D) with D = R/mu, the gradient is ``X_D/mu (dR - D dmu + r dg)``, where
    ``r = X_g mu / X_D``. The linearisation adds the difference of mu between the measured and the
    fault-free g.
    """
    rule, excess = hypothesis.fault.rule, at[EXCESS]
    ratio = graph.mul(mu, lower(graph, rule.ratio, at))
    change = graph.square(graph.mul(spread.curvature, excess))
    of_slope = graph.mul(excess, graph.add(spread.slope, change))
    slope_part = graph.mul(excess, graph.sub(of_slope, spread.residual_slope))
    crossed = graph.sub(spread.residual_scaled, graph.mul(excess, spread.scaled_slope))
    scaled_part = graph.mul(ratio, graph.add(graph.mul(ratio, spread.scaled), crossed))
    variance = graph.sum([spread.residual, slope_part, scaled_part])
    outer = graph.apply("abs", graph.div(lower(graph, rule.by_excess, at), mu))
    return graph.mul(outer, graph.apply("sqrt", variance))


def _text(hypothesis: Hypothesis, cell: Signature) -> str:
    """The rule in the notation of the paper."""
    if hypothesis.fault.fault.acts_on == "flow":
        flow = {"g": signed_sum(cell.faulty), "D": "R"}
        degree = _with(hypothesis.fault.rule.text, flow)
        return f"x = {degree}, R = {cell.residual}"
    name = hypothesis.target
    mu = signed_sum((s, f"d({o})/d({name})") for s, o in cell.faulty)
    degree = _with(hypothesis.fault.rule.text, {"g": name})
    return f"x = {degree}, D = R/mu, mu = {mu}, R = {cell.residual}"


def _with(text: str, names: Mapping[str, str]) -> str:
    return re.sub(r"\b[gD]\b", lambda m: names.get(m[0], m[0]), text)


# Covariances between observers, targets of faults, and slopes; each is built once. A residual at
# the end of a long plant sums many observers, but only those that share an input with a fault's
# module can correlate with it. An index of inputs finds them, so the effort per rule does not grow
# with the plant.

Signed = list[tuple[int, Gradient]]
"""A signed sum of gradients."""


class Moments:
    """Second moments over the gradients of an assembly."""

    def __init__(self, residuals: Sequence[Residual], assembly: Assembly) -> None:
        self._assembly, self._graph = assembly, assembly.graph
        self._signs = {r.id: {o: s for s, o in r.terms} for r in residuals}
        self._known: dict[tuple[int, int], Node] = {}
        self._related: dict[int, frozenset[str]] = {}
        self._sums: dict[tuple[tuple[int, int], ...], Gradient] = {}

    def gathered(self, gradients: Signed) -> Signed:
        """Combine a long sum to one gradient, so that products do not grow with its square."""
        if len(gradients) <= LONG_SUM:
            return gradients
        key = tuple((s, id(g)) for s, g in gradients)
        if key not in self._sums:
            self._sums[key] = combine(self._graph, gradients)
        return [(1, self._sums[key])]

    def of(self, a: Gradient, b: Gradient) -> Node:
        """Covariance of two gradients; the tables themselves are the key."""
        key = (id(a), id(b))
        node = self._known.get(key)
        if node is None:
            node = self._known[key] = covariance(self._graph, a, b)
        return node

    def with_residual(self, residual: str, gradients: Signed) -> Node:
        """Covariance of a residual with a signed sum of gradients."""
        signs, whole = self._signs[residual], self._assembly.residual_gradients[residual]
        terms: list[tuple[int, Node]] = []
        for sign, gradient in gradients:
            shared = self._correlated(gradient) & signs.keys()
            if len(shared) > MANY_CORRELATED:
                terms.append((sign, self.of(gradient, whole)))
                continue
            for observer in sorted(shared):
                node = self.of(self._assembly.gradients[observer], gradient)
                terms.append((sign * signs[observer], node))
        return self._graph.signed_sum(terms)

    def between(self, first: Signed, second: Signed) -> Node:
        """Covariance of two signed sums of gradients."""
        return self._graph.signed_sum((s * t, self.of(a, b)) for s, a in first for t, b in second)

    @cached_property
    def _readers(self) -> Mapping[str, frozenset[str]]:
        """Observers by the inputs they depend on."""
        found: dict[str, set[str]] = {}
        for observer, gradient in self._assembly.gradients.items():
            for name in gradient:
                found.setdefault(name, set()).add(observer)
        return {name: frozenset(observers) for name, observers in found.items()}

    def _correlated(self, gradient: Gradient) -> frozenset[str]:
        """Observers that share an input with a gradient."""
        known = self._related.get(id(gradient))
        if known is None:
            parts = [self._readers.get(name, frozenset()) for name in gradient]
            known = self._related[id(gradient)] = frozenset().union(*parts)
        return known
