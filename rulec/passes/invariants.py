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


def check_invariants(field: str, known: Compilation) -> None:
    """Check the result of a pass; raises `Broken` with all violations."""
    wrong = list(INVARIANTS[field](known)) if field in INVARIANTS else []
    if wrong:
        raise Broken(f"{field}: {'; '.join(wrong)}")


def _network(known: Compilation) -> Iterator[str]:
    """Balances and sums contain only modules of the plant."""
    modules = known.plant.modules
    for balance in known.network.balances:
        for name in (*balance.outlets, *balance.inlets):
            if name not in modules:
                yield f"a balance of {name}, which is no module"
    for (module, _), flow in known.network.sums.items():
        if not {module, *flow.terms} <= modules.keys():
            yield f"a sum for {module} over what is no module"


def _residuals(known: Compilation) -> Iterator[str]:
    """Residuals are signed sums of known observers, each at most once, and have unique ids."""
    observers = set(known.plant.observers)
    for residual in known.residuals:
        names = [o for _, o in residual.terms]
        if len(set(names)) < len(names) or not set(names) <= observers:
            yield f"{residual.id} is over {', '.join(names)}"
        if {sign for sign, _ in residual.terms} - {1, -1}:
            yield f"{residual.id} has factors other than 1 and -1"
    ids = [r.id for r in known.residuals]
    if len(set(ids)) < len(ids):
        yield "two residuals have one id"


def _types(known: Compilation) -> Iterator[str]:
    """Each type in use has a model."""
    for module in known.plant.modules.values():
        if module.type.key not in known.types:
            yield f"no model of {module.type.key}"


def _assembly(known: Compilation) -> Iterator[str]:
    """Observers have nodes and gradients, residuals have nodes; faults affect known observers."""
    assembly = known.assembly
    if assembly.observers.keys() != assembly.gradients.keys():
        yield "observers without gradient, or gradients without observer"
    if {r.id for r in known.residuals} != assembly.residual_nodes.keys():
        yield "nodes are not those of the residuals"
    for hypothesis in assembly.hypotheses:
        if not set(hypothesis.affects) <= assembly.observers.keys():
            yield f"{hypothesis.id} acts on what is no observer"


def _signatures(known: Compilation) -> Iterator[str]:
    """Cells have known faults and residuals, and a finite sensitivity of their sign."""
    faults = {h.id for h in known.assembly.hypotheses}
    for cell in known.signatures.cells:
        if cell.fault not in faults or cell.residual not in known.assembly.residual_nodes:
            yield f"{cell.fault} in {cell.residual} is no cell of this plant"
        if not math.isfinite(cell.sensitivity) or cell.sign * cell.sensitivity <= 0.0:
            yield f"{cell.fault} in {cell.residual}: {cell.sensitivity}"


def _rules(known: Compilation) -> Iterator[str]:
    """The most telling cells of each fault have rules, whose forms are outputs."""
    telling = [(c.fault, c.residual) for c in most_telling(known.signatures.cells)]
    if [(r.fault, r.residual) for r in known.rules] != telling:
        yield "rules are not those of the cells"
    outputs = known.assembly.graph.outputs
    for rule in known.rules:
        key = f"{rule.fault}:{rule.residual}"
        missing = [form for form in rule.forms if f"x:{form}:{key}" not in outputs]
        if missing:
            yield f"{key} lacks {', '.join(missing)}"


def _simulation(known: Compilation) -> Iterator[str]:
    """No reading is both given and solved for, and none is solved for twice."""
    steps = known.simulation.steps
    solved = [name for step in steps for name in step.readings]
    if len(set(solved)) < len(solved) or set(solved) & set(known.simulation.given):
        yield "a reading is solved for twice, or given as well"


def _balanced(known: Compilation) -> Iterator[str]:
    """Balances hold each fault once."""
    faults = known.balanced.dynamics.faults if known.balanced.dynamics else ()
    if len(set(faults)) < len(faults):
        yield "a fault is built into the balances twice"


def _ruleset(known: Compilation) -> Iterator[str]:
    """The plan has all outputs that the runtime needs."""
    outputs = known.ruleset.plan.outputs
    needed = [f"q:{o.id}" for o in known.ruleset.observers]
    needed += [f"{kind}:{r.id}" for r in known.ruleset.residuals for kind in ("R", "u")]
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
