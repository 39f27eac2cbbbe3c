"""Pass 8, derive rules: from a residual to a fault degree, with uncertainty.

All rules have the same structure. `g` is the target that the fault scales, and `mu` = dR/dg. The
residual gives the excess of g, ``D = R/mu``, and the law of the fault gives the degree from g and
D. The forms differ in mu or D:

linear : slope at the measured point, at the same flow (default).
paper : slope that includes the reaction of the true flow (Eq. 16 of the seed paper).
exact : D from the observer solved for g, without linearisation; if only one observer is wrong.

For leakage and power readings, the linear rule is already exact.
"""

import re
from collections.abc import Mapping

import sympy
from rulec_runtime.contract.ruleset import Cell

from rulec.algebra.graph import Node
from rulec.algebra.recipe import lower
from rulec.language.write_yaml import signed_sum
from rulec.passes.assemble import Assembly, Gradient, Hypothesis, TargetNodes, combine, covariance
from rulec.passes.derive_residuals import Residual, Terms
from rulec.passes.derive_signatures import Signature, Signatures, most_telling
from rulec.passes.differentiate import EXCESS, FLOW, G
from rulec.passes.limits import LONG_SUM, MANY_CORRELATED

Signed = list[tuple[int, Gradient]]
"""A signed sum of gradients."""


def derive_rules(
    residuals: tuple[Residual, ...], assembly: Assembly, signatures: Signatures
) -> tuple[Cell, ...]:
    """Add observers, residuals, gradients, guards and all rules to the outputs of the graph.

    >>> from rulec.passes.pipeline import example
    >>> example("rules").rules[0].equation
    'x = R/A.pump, R = A.pump-plant'
    """
    _basic_outputs(assembly)
    hypotheses = {h.id: h for h in assembly.hypotheses}
    terms = {r.id: r.terms for r in residuals}
    return tuple(
        _rule(assembly, hypotheses[cell.fault], cell, terms[cell.residual])
        for cell in most_telling(signatures.cells)
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


def _rule(assembly: Assembly, hypothesis: Hypothesis, cell: Signature, terms: Terms) -> Cell:
    graph, outputs, forms = assembly.graph, assembly.graph.outputs, list[str]()
    key, degree = f"{cell.fault}:{cell.residual}", hypothesis.fault.rule.degree
    R, target = assembly.residual_nodes[cell.residual], _target(assembly, hypothesis)

    def add(form: str, mu: Node, scaled: Node, gradients: Signed) -> None:
        at = {G: scaled, EXCESS: graph.div(R, mu)}
        found = _degree(assembly, hypothesis, cell, terms, gradients, mu, at)
        outputs[f"x:{form}:{key}"], outputs[f"ux:{form}:{key}"] = found
        forms.append(form)

    if target is None:
        own = [(s, assembly.gradients[o]) for s, o in cell.faulty]
        add("linear", cell.slope, cell.scaled, own)
        return cell.cell(tuple(forms), _text(hypothesis, cell))
    add("linear", cell.slope, cell.scaled, [(1, target.gradient)])
    if hypothesis.fault.fault.acts_on == "definition":
        count = graph.constant(sum(sign for sign, _ in cell.faulty))
        mu = graph.sub(cell.slope, graph.mul(count, target.reaction))
        add("paper", mu, target.whole, [(1, target.whole_gradient)])
    sign, observer = cell.faulty[0]
    if len(cell.faulty) == 1 and observer in target.inverse:
        # The excess is g minus the g at which the residual vanishes.
        expression, nodes = target.inverse[observer]
        should = graph.signed_sum([(1, assembly.observers[observer]), (-sign, R)])
        flow = sympy.Symbol(FLOW, real=True)
        exact = graph.sub(cell.scaled, lower(graph, expression, {**nodes, flow: should}))
        outputs[f"x:exact:{key}"] = lower(graph, degree, {G: cell.scaled, EXCESS: exact})
        forms.append("exact")
    return cell.cell(tuple(forms), _text(hypothesis, cell))


def _target(assembly: Assembly, hypothesis: Hypothesis) -> TargetNodes | None:
    """What a fault scales; None if it scales the flow, with a slope of exactly 1."""
    of_flow = hypothesis.fault.fault.acts_on == "flow"
    return None if of_flow else assembly.targets[hypothesis.target]


def _degree(
    assembly: Assembly,
    hypothesis: Hypothesis,
    cell: Signature,
    terms: Terms,
    scaled: Signed,
    mu: Node,
    at: Mapping[sympy.Symbol, Node],
) -> tuple[Node, Node]:
    """A degree and its standard uncertainty, of first order in R, g and mu with all correlations.

    For the degree X(g, D) with D = R/mu, the gradient is ``X_D/mu (dR - D dmu + r dg)``, where
    ``r = X_g mu / X_D``; `scaled` sums to dg. The linearisation adds the difference of mu between
    the measured and the fault-free g.
    """
    graph, rule, excess = assembly.graph, hypothesis.fault.rule, at[EXCESS]

    def gathered(gradients: Signed) -> Signed:
        long = len(gradients) > LONG_SUM  # else products would grow with its square
        return [(1, combine(graph, gradients))] if long else gradients

    def between(first: Signed, second: Signed) -> Node:
        pairs = ((s * t, covariance(graph, a, b)) for s, a in first for t, b in second)
        return graph.signed_sum(pairs)

    def with_residual(gradients: Signed) -> Node:
        if len(terms) > MANY_CORRELATED:
            return between(gradients, [(1, assembly.residual_gradients[cell.residual])])
        own = [(s, assembly.gradients[o]) for s, o in sorted(terms, key=lambda t: t[1])]
        pairs = ((s * t, covariance(graph, a, b)) for t, b in gradients for s, a in own)
        return graph.signed_sum(pairs)

    def twice(node: Node) -> Node:
        return graph.mul(graph.constant(2.0), node)

    scaled, slope, curvature = gathered(scaled), list[tuple[int, Gradient]](), graph.zero
    of_scaled, residual_scaled = between(scaled, scaled), twice(with_residual(scaled))
    if target := _target(assembly, hypothesis):
        slope = gathered([(s, target.slope_gradients[o]) for s, o in cell.faulty])
    of_slope, residual_slope = between(slope, slope), twice(with_residual(slope))
    scaled_slope = twice(between(scaled, slope))
    if target:
        curvature = graph.signed_sum((s, target.curvatures[o]) for s, o in cell.faulty)
    degree = lower(graph, rule.degree, at)
    ratio = graph.mul(mu, lower(graph, rule.ratio, at))
    change = graph.square(graph.mul(curvature, excess))
    by_slope = graph.mul(excess, graph.add(of_slope, change))
    slope_part = graph.mul(excess, graph.sub(by_slope, residual_slope))
    crossed = graph.sub(residual_scaled, graph.mul(excess, scaled_slope))
    scaled_part = graph.mul(ratio, graph.add(graph.mul(ratio, of_scaled), crossed))
    variance = graph.sum([assembly.residual_variances[cell.residual], slope_part, scaled_part])
    outer = graph.apply("abs", graph.div(lower(graph, rule.by_excess, at), mu))
    return degree, graph.mul(outer, graph.apply("sqrt", variance))


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
