"""Invariants after each pass, checked if `RULEC_CHECKS` is set, as in the tests."""

import math
import os
from collections.abc import Callable, Iterator, Mapping

from rulec.passes.derive_signatures import most_telling
from rulec.passes.types import Compilation


class Broken(Exception):
    """Raised if the result of a pass violates an invariant; the message says which."""


def checks_are_on() -> bool:
    """Whether invariants are checked."""
    return bool(os.environ.get("RULEC_CHECKS"))


def check_invariants(field: str, models: Compilation) -> None:
    """Check the result of a pass; raises `Broken` with all violations."""
    wrong = list(INVARIANTS[field](models)) if field in INVARIANTS else []
    if wrong:
        raise Broken(f"{field}: {'; '.join(wrong)}")


def _network(models: Compilation) -> Iterator[str]:
    """Balances and sums contain only modules of the plant."""
    modules = models.plant.modules
    for balance in models.network.balances:
        for name in (*balance.outlets, *balance.inlets):
            if name not in modules:
                yield f"a balance of {name}, which is no module"
    for (module, _), flow in models.network.sums.items():
        if not {module, *flow.terms} <= modules.keys():
            yield f"a sum for {module} over what is no module"


def _residuals(models: Compilation) -> Iterator[str]:
    """Residuals are signed sums of known observers, each at most once, and have unique ids."""
    observers = set(models.plant.observers)
    for residual in models.residuals:
        names = [o for _, o in residual.terms]
        if len(set(names)) < len(names) or not set(names) <= observers:
            yield f"{residual.id} is over {', '.join(names)}"
        if {sign for sign, _ in residual.terms} - {1, -1}:
            yield f"{residual.id} has factors other than 1 and -1"
    ids = [r.id for r in models.residuals]
    if len(set(ids)) < len(ids):
        yield "two residuals have one id"


def _types(models: Compilation) -> Iterator[str]:
    """Each type in use has a model."""
    for module in models.plant.modules.values():
        if module.type.key not in models.types:
            yield f"no model of {module.type.key}"


def _assembly(models: Compilation) -> Iterator[str]:
    """Observers have nodes and gradients, residuals have nodes; faults affect known observers."""
    assembly = models.assembly
    if assembly.observers.keys() != assembly.gradients.keys():
        yield "observers without gradient, or gradients without observer"
    if {r.id for r in models.residuals} != assembly.residual_nodes.keys():
        yield "nodes are not those of the residuals"
    for hypothesis in assembly.hypotheses:
        if not set(hypothesis.affects) <= assembly.observers.keys():
            yield f"{hypothesis.id} acts on what is no observer"


def _signatures(models: Compilation) -> Iterator[str]:
    """Cells have known faults and residuals, and a finite sensitivity of their sign."""
    faults = {h.id for h in models.assembly.hypotheses}
    for cell in models.signatures.cells:
        if cell.fault not in faults or cell.residual not in models.assembly.residual_nodes:
            yield f"{cell.fault} in {cell.residual} is no cell of this plant"
        if not math.isfinite(cell.sensitivity) or cell.sign * cell.sensitivity <= 0.0:
            yield f"{cell.fault} in {cell.residual}: {cell.sensitivity}"


def _rules(models: Compilation) -> Iterator[str]:
    """The most telling cells of each fault have rules, whose forms are outputs."""
    telling = [(c.fault, c.residual) for c in most_telling(models.signatures.cells)]
    if [(r.fault, r.residual) for r in models.rules] != telling:
        yield "rules are not those of the cells"
    outputs = models.assembly.graph.outputs
    for rule in models.rules:
        key = f"{rule.fault}:{rule.residual}"
        missing = [form for form in rule.forms if f"x:{form}:{key}" not in outputs]
        if missing:
            yield f"{key} lacks {', '.join(missing)}"


def _simulation(models: Compilation) -> Iterator[str]:
    """No reading is both given and solved for, and none is solved for twice."""
    steps = models.simulation.steps
    solved = [name for step in steps for name in step.readings]
    if len(set(solved)) < len(solved) or set(solved) & set(models.simulation.given):
        yield "a reading is solved for twice, or given as well"


def _balanced(models: Compilation) -> Iterator[str]:
    """Balances hold each fault once."""
    faults = models.balanced.dynamics.faults if models.balanced.dynamics else ()
    if len(set(faults)) < len(faults):
        yield "a fault is built into the balances twice"


def _ruleset(models: Compilation) -> Iterator[str]:
    """The plan has all outputs that the runtime needs."""
    outputs = models.ruleset.plan.outputs
    needed = [f"q:{o.id}" for o in models.ruleset.observers]
    needed += [f"{kind}:{r.id}" for r in models.ruleset.residuals for kind in ("R", "u")]
    missing = [name for name in needed if name not in outputs]
    if missing:
        yield f"no output {', '.join(missing)}"


INVARIANTS: Mapping[str, Callable[[Compilation], Iterator[str]]] = {
    "network": _network,
    "residuals": _residuals,
    "types": _types,
    "assembly": _assembly,
    "signatures": _signatures,
    "rules": _rules,
    "simulation": _simulation,
    "balanced": _balanced,
    "ruleset": _ruleset,
}
