"""`rulec show`: what a compiler pass made, in readable form."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from rulec_runtime.commands.destinations import console
from rulec_runtime.contract.ruleset import Ruleset

from rulec.effects.match_effects import Matches, match_effects
from rulec.effects.model_builder import open_builder
from rulec.effects.tell_balances import balances_told, flow_told
from rulec.knowledge.plant import Plant
from rulec.knowledge.read import Sources
from rulec.language.diagnostics import did_you_mean
from rulec.passes.analyse_isolability import Isolability
from rulec.passes.assemble import Assembly
from rulec.passes.derive_residuals import Residuals
from rulec.passes.derive_rules import Rules
from rulec.passes.derive_signatures import Signatures
from rulec.passes.differentiate import Models
from rulec.passes.link import Network
from rulec.passes.order_equations import Ordered
from rulec.passes.pipeline import PASSES, run_passes, up_to
from rulec.passes.put_balances import Balanced


def run(options: argparse.Namespace) -> int:
    """Run the passes up to the named one and print its result."""
    out = console(options)
    names = [*(p.__name__ for p in PASSES), match_effects.__name__]
    short = [n for n in names if options.step in n.split("_")]
    if len(short) == 1:
        options.step = short[0]
    if options.step not in names:
        asked = options.step == "passes"
        text = (
            ""
            if asked
            else f"there is no pass '{options.step}'; {did_you_mean(options.step, names)}\n"
        )
        out.print(text + "passes in order: " + ", ".join(names))
        return 0 if asked else 2
    if options.step == match_effects.__name__:
        result: Any = open_builder(Path(options.plant))[1].matches
    else:
        result = run_passes(Path(options.plant), up_to(options.step))
    for line in _LINES[type(result)](result):
        out.print(line, soft_wrap=True)
    return 0


def _sources(sources: Sources) -> Iterator[str]:
    yield f"knowledge base {sources.kb}"
    for kind, documents in sources.by_kind.items():
        for document in documents:
            yield f"{kind}: {document.path}"
    yield f"digest {sources.digest()}"


def _plant(plant: Plant) -> Iterator[str]:
    yield f"{plant.name}: {plant.title}"
    for module in plant.modules.values():
        yield f"\n{module.name}: {module.type.name}, {module.title}"
        for p in module.parameters.values():
            value, u = p.unit.from_si(p.value), p.u / p.unit.factor
            where = f"{p.origin.file}:{p.origin.line} {p.origin.source}"
            yield f"  {p.name} = {value:.6g} +- {u:.2g} {p.unit.text}   [{where}]"


def _network(network: Network) -> Iterator[str]:
    for balance in network.balances:
        yield f"{' + '.join(balance.outlets)} = {' + '.join(balance.inlets)}   (flows)"
    for (module, name), signals in network.gathers.items():
        parts = " + ".join(f"{m}.{s}" for m, s in signals) or "0"
        yield f"{module}: downstream({name}) = {parts}"
    for (module, kind), flow in network.sums.items():
        terms = (f"{'+' if sign > 0 else '-'} {m}.{kind}" for m, sign in flow.terms.items())
        text = " ".join(terms)
        yield f"{module}.{kind} = {text.removeprefix('+ ')}"
    for module, end in network.ends:
        yield f"{module}.{end} = {flow_told(network, module, end)}"


def _residuals(residuals: Residuals) -> Iterator[str]:
    for residual in residuals.residuals:
        yield f"{residual.id} = {residual}"


def _models(models: Models) -> Iterator[str]:
    for model in models.types.values():
        yield f"\n{model.type.key}"
        for name, expression in model.observers.items():
            yield f"  Q_{name} = {expression}"
        for target in model.targets.values():
            for observer, slope in target.slopes.items():
                yield f"  d Q_{observer} / d {target.name} = {slope}"
        for fault in model.faults:
            yield f"  {fault.id}: degree = {fault.rule.degree}, wrong: {', '.join(fault.affects)}"


def _assembly(assembly: Assembly) -> Iterator[str]:
    yield f"{len(assembly.observers)} observers, {len(assembly.residual_nodes)} residuals"
    for hypothesis in assembly.hypotheses:
        yield f"{hypothesis.id} makes wrong: {', '.join(hypothesis.affects)}"


def _signatures(signatures: Signatures) -> Iterator[str]:
    yield "reference point (m3/s)"
    for observer, flow in signatures.flows.items():
        yield f"  {observer} = {flow:.6g}"
    for cell in signatures.cells:
        sign = "+" if cell.sign > 0 else "-"
        yield (
            f"{cell.fault} {sign} {cell.residual}: dR/dg = {cell.gain:.4g}, "
            f"dR/dx = {cell.sensitivity:.4g} m3/s, seen from x = {cell.detectable:.3g}"
        )


def _rules(rules: Rules) -> Iterator[str]:
    for rule in rules.rules:
        yield f"{rule.signature.fault}: {rule.equation}   [{', '.join(rule.forms)}]"


def _isolability(isolability: Isolability) -> Iterator[str]:
    for group in isolability.groups:
        yield f"{group.kind}: {', '.join(group.faults)}: {group.advice}"
    for name in isolability.unobserved:
        yield f"unobserved: {name}"


def _ordered(ordered: Ordered) -> Iterator[str]:
    if ordered.simulation.refused:
        yield ordered.simulation.refused
        return
    yield f"given: {', '.join(ordered.simulation.given)}"
    for number, step in enumerate(ordered.simulation.steps, 1):
        yield f"step {number} finds {', '.join((*step.readings, *step.flows))}"
        for terms in step.zeros:
            yield f"  0 = {_signed(terms)}"
        for flow, terms in step.flows.items():
            yield f"  flow of {flow} = {_signed(terms)}"


def _signed(terms: Mapping[str, float]) -> str:
    sizes = {name: "" if abs(c) == 1.0 else f"{abs(c):g} " for name, c in terms.items()}
    text = " ".join(f"{'+' if c > 0 else '-'} {sizes[name]}{name}" for name, c in terms.items())
    return text.removeprefix("+ ") or "0"


def _balanced(balanced: Balanced) -> Iterator[str]:
    if balanced.dynamics is None:
        yield "nothing is stored"
        return
    network = balanced.ordered.isolability.rules.signatures.assembly.residuals.network
    yield f"given: {', '.join(balanced.dynamics.inputs) or 'nothing'}"
    for module in network.plant.modules.values():
        yield from balances_told(network, module)


def _ruleset(ruleset: Ruleset) -> Iterator[str]:
    plan = ruleset.plan
    yield f"plan: {len(plan.inputs)} inputs, {len(plan.operations)} operations"
    numbered = [*plan.inputs, *(f"{c:.6g}" for c in plan.constants)]
    for i, (name, a, b) in enumerate(plan.operations[:2000], plan.first_operation):
        yield f"v{i} = {name}({_value(numbered, a)}, {_value(numbered, b)})"
    for name, i in plan.outputs.items():
        yield f"{name} = {_value(numbered, i)}"


def _matches(matches: Matches) -> Iterator[str]:
    by_module: dict[str, list[str]] = {}
    for matched in matches.candidates:
        candidate = matched.candidate
        names = ", ".join(u.name for u in candidate.unknowns if not u.fixed)
        lines = by_module.setdefault(candidate.module, [])
        lines.append(f"  {candidate.id} ({candidate.sort}): {candidate.equation}   [{names}]")
    for missing in matches.missing:
        lines = by_module.setdefault(missing.module, [])
        sensor = f"; {missing.sensor}" if missing.sensor else ""
        lines.append(f"  {missing.name}@{missing.place}: {missing.quantity} is not read{sensor}")
    for module, lines in by_module.items():
        yield f"\n{module}"
        yield from lines


def _value(numbered: list[str], i: int) -> str:
    return numbered[i] if i < len(numbered) else f"v{i}"


_LINES: dict[type, Callable[[Any], Iterator[str]]] = {
    Sources: _sources,
    Plant: _plant,
    Network: _network,
    Residuals: _residuals,
    Models: _models,
    Assembly: _assembly,
    Signatures: _signatures,
    Rules: _rules,
    Isolability: _isolability,
    Ordered: _ordered,
    Balanced: _balanced,
    Ruleset: _ruleset,
    Matches: _matches,
}
