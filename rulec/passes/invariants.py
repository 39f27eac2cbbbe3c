"""Invariants after each pass, checked if `RULEC_CHECKS` is set, as in the tests."""

import math
import os
from collections.abc import Iterator

from rulec.passes.derive_signatures import most_telling
from rulec.passes.types import Compilation


class Broken(Exception):
    """Raised if the result of a pass violates an invariant; the message says which."""


def checks_are_on() -> bool:
    """Whether invariants are checked."""
    return bool(os.environ.get("RULEC_CHECKS"))


def check_invariants(field: str, known: Compilation) -> None:
    """Check the result of a pass; raises `Broken` with all violations."""
    first = field in ("network", "residuals", "types", "assembly", "signatures")
    wrong = list(_of_equations(field, known) if first else _of_results(field, known))
    if wrong:
        raise Broken(f"{field}: {'; '.join(wrong)}")


def _of_equations(field: str, known: Compilation) -> Iterator[str]:
    """What does not hold after the passes up to the fault-symptom matrix."""
    modules, assembly = known.plant.modules, known.assembly
    match field:
        case "network":
            named = {n for b in known.network.balances for n in (*b.outlets, *b.inlets)}
            named |= {n for (m, _), flow in known.network.sums.items() for n in (m, *flow.terms)}
            yield from (f"{name} is no module" for name in sorted(named - modules.keys()))
        case "residuals":
            observers = set(known.plant.observers)
            for residual in known.residuals:
                signs, names = zip(*residual.terms, strict=True)
                if len(set(names)) < len(names) or not set(names) <= observers:
                    yield f"{residual.id} is over {', '.join(names)}"
                if set(signs) - {1, -1}:
                    yield f"{residual.id} has factors other than 1 and -1"
            if len({r.id for r in known.residuals}) < len(known.residuals):
                yield "two residuals have one id"
        case "types":
            for key in {m.type.key for m in modules.values()}:
                model = known.types.get(key)
                if model is None or model.observers.keys() != model.gradients.keys():
                    yield f"{key} has no model, or observers without gradient"
        case "assembly":
            if assembly.observers.keys() != assembly.gradients.keys():
                yield "observers without gradient, or gradients without observer"
            if {r.id for r in known.residuals} != assembly.residual_nodes.keys():
                yield "nodes are not those of the residuals"
            for hypothesis in assembly.hypotheses:
                if not set(hypothesis.affects) <= assembly.observers.keys():
                    yield f"{hypothesis.id} acts on what is no observer"
        case "signatures":
            faults = {h.id for h in assembly.hypotheses}
            for cell in known.signatures.cells:
                place = f"{cell.fault} in {cell.residual}"
                if cell.fault not in faults or cell.residual not in assembly.residual_nodes:
                    yield f"{place} is no cell of this plant"
                if not math.isfinite(cell.sensitivity) or cell.sign * cell.sensitivity <= 0.0:
                    yield f"{place}: {cell.sensitivity}"


def _of_results(field: str, known: Compilation) -> Iterator[str]:
    """What does not hold after the passes that use the matrix."""
    match field:
        case "rules":
            if [r.signature for r in known.rules] != list(most_telling(known.signatures.cells)):
                yield "rules are not those of the cells"
            for rule in known.rules:
                key = f"{rule.signature.fault}:{rule.signature.residual}"
                forms = {f"x:{form}:{key}" for form in rule.forms}
                if lacking := sorted(forms - known.assembly.graph.outputs.keys()):
                    yield f"no output {', '.join(lacking)}"
        case "simulation":
            solved = [name for step in known.simulation.steps for name in step.readings]
            if len(set(solved)) < len(solved) or set(solved) & set(known.simulation.given):
                yield "a reading is solved for twice, or given as well"
        case "balanced":
            faults = known.balanced.dynamics.faults if known.balanced.dynamics else ()
            if len(set(faults)) < len(faults):
                yield "a fault is built into the balances twice"
        case "ruleset":
            needed = {f"q:{o.id}" for o in known.ruleset.observers}
            needed |= {f"{k}:{r.id}" for r in known.ruleset.residuals for k in ("R", "u")}
            if lacking := sorted(needed - known.ruleset.plan.outputs.keys()):
                yield f"no output {', '.join(lacking)}"
