"""Pass 8, derive rules: from a residual to a fault degree, with uncertainty.

Every rule has one form. `g` is what the fault scales, `mu` = dR/dg; the residual says how much of
g is there too much, ``D = R/mu``; the law of the fault turns g and D into the degree. The forms
differ in what they take for mu or D:

linear : slope at the measured point, at the same flow (default).
paper : slope that includes the answer of the true flow (Eq. 16 of the seed paper).
exact : D from the observer solved for g, no linearisation; where one observer alone is wrong.

For leakage and power readings the linear rule is exact already.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy

from rulec.assemble import Assembly, Gradient, Hypothesis, covariance
from rulec.derive_signatures import Signature, Signatures
from rulec.differentiate import FLOW
from rulec.graph import Graph, Node


@dataclass(frozen=True)
class Rule:
    """The forms that a cell has in the plan, and the rule as readable text."""

    signature: Signature
    forms: tuple[str, ...]
    equation: str


@dataclass(frozen=True)
class Rules:
    """Signatures with rules; the graph of the assembly now has all outputs."""

    signatures: Signatures
    rules: tuple[Rule, ...]


def derive_rules(signatures: Signatures) -> Rules:
    """Add observers, residuals, gradients, guards and all rules to the outputs of the graph."""
    assembly = signatures.assembly
    _basic_outputs(assembly)
    hypotheses = {h.id: h for h in assembly.hypotheses}
    rules = tuple(_rule(assembly, hypotheses[c.fault], c) for c in signatures.cells)
    return Rules(signatures, rules)


def _basic_outputs(assembly: Assembly) -> None:
    """``q:``, ``s:`` (scaled gradient), ``guard:``, ``R:`` and ``u:`` outputs."""
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


def _rule(assembly: Assembly, hypothesis: Hypothesis, cell: Signature) -> Rule:
    graph, outputs = assembly.graph, assembly.graph.outputs
    key = f"{cell.fault}:{cell.residual}"
    R = assembly.residual_nodes[cell.residual]
    degree = hypothesis.fault.degree
    g, D = sympy.symbols("g D", real=True)

    def rule(mu: Node, form: str) -> None:
        excess = graph.div(R, mu)
        outputs[f"x:{form}:{key}"] = graph.lower(degree, {g: cell.scaled, D: excess})
        outputs[f"ux:{form}:{key}"] = _uncertainty(assembly, hypothesis, cell, mu, excess)

    rule(cell.slope, "linear")
    forms = ["linear"]
    if hypothesis.fault.fault.acts_on == "definition":
        target = assembly.targets[hypothesis.target]
        count = sum(sign for sign, _ in cell.faulty)
        reaction = graph.mul(graph.constant(count), target.reaction)
        rule(graph.sub(cell.slope, reaction), "paper")
        forms.append("paper")
    exact = _exact_excess(assembly, hypothesis, cell, R)
    if exact is not None:
        outputs[f"x:exact:{key}"] = graph.lower(degree, {g: cell.scaled, D: exact})
        forms.append("exact")
    return Rule(cell, tuple(forms), _text(hypothesis, cell))


def _exact_excess(
    assembly: Assembly, hypothesis: Hypothesis, cell: Signature, R: Node
) -> Node | None:
    """g minus the g at which the residual vanishes, where one observer alone depends on it."""
    if hypothesis.fault.fault.acts_on == "flow" or len(cell.faulty) != 1:
        return None
    (sign, observer), graph = cell.faulty[0], assembly.graph
    solved = assembly.targets[hypothesis.target].inverse.get(observer)
    if solved is None:
        return None
    expression, nodes = solved
    should = graph.signed_sum([(1, assembly.observers[observer]), (-sign, R)])
    flow = sympy.Symbol(FLOW, real=True)
    return graph.sub(cell.scaled, graph.lower(expression, {**nodes, flow: should}))


def _uncertainty(
    assembly: Assembly, hypothesis: Hypothesis, cell: Signature, mu: Node, excess: Node
) -> Node:
    """Standard uncertainty of a degree: first order in R, g and mu with all correlations.

    With the degree X(g, D) and D = R/mu its gradient is ``X_D/mu (dR - D dmu + r dg)``, where
    ``r = X_g mu / X_D``. To this the linearisation adds how much mu itself differs between the
    measured and the fault-free g.
    """
    graph = assembly.graph
    g, D = sympy.symbols("g D", real=True)
    degree = hypothesis.fault.degree
    by_excess = sympy.diff(degree, D)
    at = {g: cell.scaled, D: excess}
    ratio = graph.mul(mu, graph.lower(sympy.cancel(sympy.diff(degree, g) / by_excess), at))
    scaled = _scaled_covariances(assembly, hypothesis, cell)
    with_scaled = scaled.twice_with_residual
    slope_part = graph.zero
    if hypothesis.fault.fault.acts_on != "flow":
        slope = _slope_covariances(assembly, hypothesis, cell)
        with_scaled = graph.sub(with_scaled, graph.mul(excess, slope.twice_with_scaled))
        change = graph.square(graph.mul(slope.curvature, excess))
        spread = graph.mul(excess, graph.add(slope.variance, change))
        slope_part = graph.mul(excess, graph.sub(spread, slope.twice_with_residual))
    scaled_part = graph.mul(ratio, graph.add(graph.mul(ratio, scaled.variance), with_scaled))
    variance = graph.sum([assembly.residual_variances[cell.residual], slope_part, scaled_part])
    outer = graph.apply("abs", graph.div(graph.lower(by_excess, at), mu))
    return graph.mul(outer, graph.apply("sqrt", variance))


@dataclass(frozen=True)
class _Scaled:
    """Second moments of what a fault scales."""

    variance: Node
    twice_with_residual: Node


@dataclass(frozen=True)
class _Slope:
    """Second moments of mu, and dmu/dg."""

    variance: Node
    twice_with_residual: Node
    twice_with_scaled: Node
    curvature: Node


def _scaled_covariances(assembly: Assembly, hypothesis: Hypothesis, cell: Signature) -> _Scaled:
    graph, gradients = assembly.graph, assembly.gradients
    if hypothesis.fault.fault.acts_on == "flow":
        variance = _double(graph, cell.faulty, cell.faulty, gradients, gradients)
        terms = _terms(assembly, cell)
        twice = _double(graph, terms, cell.faulty, gradients, gradients, 2.0)
        return _Scaled(variance, twice)
    gradient = assembly.targets[hypothesis.target].gradient
    twice = graph.signed_sum(
        (s, _times(graph, 2.0, covariance(graph, gradients[o], gradient)))
        for s, o in _terms(assembly, cell)
    )
    return _Scaled(covariance(graph, gradient, gradient), twice)


def _slope_covariances(assembly: Assembly, hypothesis: Hypothesis, cell: Signature) -> _Slope:
    graph, target = assembly.graph, assembly.targets[hypothesis.target]
    slopes = target.slope_gradients
    return _Slope(
        _double(graph, cell.faulty, cell.faulty, slopes, slopes),
        _double(graph, _terms(assembly, cell), cell.faulty, assembly.gradients, slopes, 2.0),
        graph.signed_sum(
            (s, _times(graph, 2.0, covariance(graph, slopes[o], target.gradient)))
            for s, o in cell.faulty
        ),
        graph.signed_sum((s, target.curvatures[o]) for s, o in cell.faulty),
    )


def _terms(assembly: Assembly, cell: Signature) -> tuple[tuple[int, str], ...]:
    residuals = assembly.residuals.by_id
    return residuals[cell.residual].terms


def _double(
    graph: Graph,
    first: tuple[tuple[int, str], ...],
    second: tuple[tuple[int, str], ...],
    a: Mapping[str, Gradient],
    b: Mapping[str, Gradient],
    factor: float = 1.0,
) -> Node:
    """`factor` times the covariance of two signed sums, term by term: equal terms are shared."""
    return graph.signed_sum(
        (s * t, _times(graph, factor, covariance(graph, a[o], b[p])))
        for s, o in first
        for t, p in second
    )


def _times(graph: Graph, factor: float, node: Node) -> Node:
    return graph.mul(graph.constant(factor), node)


def _text(hypothesis: Hypothesis, cell: Signature) -> str:
    """The rule in words that can be read beside the paper."""
    if hypothesis.fault.fault.acts_on == "flow":
        signed = [f"{'-' if s < 0 else '+'} {o}" for s, o in cell.faulty]
        flow = " ".join(signed).removeprefix("+ ")
        degree = _with(hypothesis.fault.degree, {"g": flow, "D": "R"})
        return f"x = {degree}, R = {cell.residual}"
    name = hypothesis.target
    slopes = [f"{'-' if s < 0 else '+'} d({o})/d({name})" for s, o in cell.faulty]
    mu = " ".join(slopes).removeprefix("+ ")
    degree = _with(hypothesis.fault.degree, {"g": name})
    return f"x = {degree}, D = R/mu, mu = {mu}, R = {cell.residual}"


def _with(expression: sympy.Expr, names: Mapping[str, str]) -> str:
    table = {sympy.Symbol(k, real=True): sympy.Symbol(v) for k, v in names.items()}
    return str(expression.xreplace(table))
