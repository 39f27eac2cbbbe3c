"""The result of each compiler pass in readable equations, and effects matched to places."""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from rulec.effects.equation_text import balances_text, flow_text
from rulec.effects.match_effects import Matches, match_effects
from rulec.effects.model_builder import open_builder
from rulec.language.write_yaml import signed_sum
from rulec.passes.pipeline import PASSES, run_passes
from rulec.passes.types import Compilation

_FIELDS = {step.__name__: field for field, step in PASSES.items()}
STEPS = (*_FIELDS, match_effects.__name__)
"""All steps that can be shown, in order."""


def lines_of(step: str, plant: Path) -> Iterator[str]:
    """Lines about the result of a step; raises `Refused` with all mistakes in the plant."""
    if step == match_effects.__name__:
        yield from _matches(open_builder(plant)[1].matches)
    else:
        field = _FIELDS[step]
        yield from _LINES[field](run_passes(Compilation(path=plant), field))


def _sources(models: Compilation) -> Iterator[str]:
    for layer in models.sources.layers:
        yield f"layer {layer.name}: {layer.folder}"
    for kind, documents in models.sources.by_kind.items():
        for document in documents:
            yield f"{kind}: {document.path}"
    yield f"digest {models.sources.digest()}"


def _plant(models: Compilation) -> Iterator[str]:
    yield f"{models.plant.name}: {models.plant.title}"
    for module in models.plant.modules.values():
        yield f"\n{module.name}: {module.type.name}, {module.title}"
        for p in module.parameters.values():
            value, u = p.unit.from_si(p.value), p.u / p.unit.factor
            where = f"{p.origin.file}:{p.origin.line} {p.origin.source}"
            yield f"  {p.name} = {value:.6g} +- {u:.2g} {p.unit.text}   [{where}]"


def _network(models: Compilation) -> Iterator[str]:
    for balance in models.network.balances:
        yield f"{' + '.join(balance.outlets)} = {' + '.join(balance.inlets)}   (flows)"
    for (module, name), signals in models.network.gathers.items():
        parts = " + ".join(f"{m}.{s}" for m, s in signals) or "0"
        yield f"{module}: downstream({name}) = {parts}"
    for (module, kind), flow in models.network.sums.items():
        terms = ((sign, f"{m}.{kind}") for m, sign in flow.terms.items())
        yield f"{module}.{kind} = {signed_sum(terms)}"
    for module, end in models.network.ends:
        yield f"{module}.{end} = {flow_text(models.network, module, end)}"


def _residuals(models: Compilation) -> Iterator[str]:
    for residual in models.residuals:
        yield f"{residual.id} = {residual}"


def _types(models: Compilation) -> Iterator[str]:
    for model in models.types.values():
        yield f"\n{model.type.key}"
        for name, expression in model.observers.items():
            yield f"  Q_{name} = {expression}"
        for target in model.targets.values():
            for observer, slope in target.slopes.items():
                yield f"  d Q_{observer} / d {target.name} = {slope}"
        for fault in model.faults:
            yield f"  {fault.id}: degree = {fault.rule.degree}, wrong: {', '.join(fault.affects)}"


def _assembly(models: Compilation) -> Iterator[str]:
    yield f"{len(models.assembly.observers)} observers, {len(models.residuals)} residuals"
    for hypothesis in models.assembly.hypotheses:
        yield f"{hypothesis.id} makes wrong: {', '.join(hypothesis.affects)}"


def _signatures(models: Compilation) -> Iterator[str]:
    yield "reference point (m3/s)"
    for observer, flow in models.signatures.flows.items():
        yield f"  {observer} = {flow:.6g}"
    for cell in models.signatures.cells:
        sign = "+" if cell.sign > 0 else "-"
        yield (
            f"{cell.fault} {sign} {cell.residual}: dR/dg = {cell.gain:.4g}, "
            f"dR/dx = {cell.sensitivity:.4g} m3/s, visible above x = {cell.detectable:.3g}"
        )


def _rules(models: Compilation) -> Iterator[str]:
    for rule in models.rules:
        yield f"{rule.fault}: {rule.equation}   [{', '.join(rule.forms)}]"


def _isolability(models: Compilation) -> Iterator[str]:
    for group in models.isolability.groups:
        yield f"{group.kind}: {', '.join(group.faults)}: {group.advice}"
    for name in models.isolability.unobserved:
        yield f"unobserved: {name}"


def _simulation(models: Compilation) -> Iterator[str]:
    if models.simulation.refused:
        yield models.simulation.refused
        return
    yield f"given: {', '.join(models.simulation.given)}"
    for number, step in enumerate(models.simulation.steps, 1):
        yield f"step {number} finds {', '.join((*step.readings, *step.flows))}"
        for terms in step.zeros:
            yield f"  0 = {_signed(terms)}"
        for flow, terms in step.flows.items():
            yield f"  flow of {flow} = {_signed(terms)}"


def _signed(terms: Mapping[str, float]) -> str:
    sizes = {name: "" if abs(c) == 1.0 else f"{abs(c):g} " for name, c in terms.items()}
    return signed_sum((c, f"{sizes[name]}{name}") for name, c in terms.items())


def _balanced(models: Compilation) -> Iterator[str]:
    dynamics = models.balanced.dynamics
    if dynamics is None:
        yield "nothing is stored"
        return
    yield f"given: {', '.join(dynamics.inputs) or 'nothing'}"
    for module in models.plant.modules.values():
        yield from balances_text(models.network, module)


def _ruleset(models: Compilation) -> Iterator[str]:
    plan = models.ruleset.plan
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


_LINES: Mapping[str, Callable[[Compilation], Iterator[str]]] = {
    lines.__name__.removeprefix("_"): lines
    for lines in (
        *(_sources, _plant, _network, _residuals, _types, _assembly, _signatures, _rules),
        *(_isolability, _simulation, _balanced, _ruleset),
    )
}
