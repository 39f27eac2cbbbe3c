"""The order of the passes. Each takes what the one before made, and changes nothing in it."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset

from rulec.knowledge.check_plant import check
from rulec.knowledge.read import read_plant
from rulec.passes.analyse_isolability import analyse_isolability
from rulec.passes.assemble import assemble
from rulec.passes.derive_residuals import derive_residuals
from rulec.passes.derive_rules import derive_rules
from rulec.passes.derive_signatures import derive_signatures
from rulec.passes.differentiate import differentiate
from rulec.passes.emit import emit
from rulec.passes.link import link
from rulec.passes.order_equations import order_equations
from rulec.passes.put_balances import put_balances

PASSES: tuple[Callable[[Any], Any], ...] = (
    read_plant,  # path -> Sources: documents with positions, schema checked
    check,  # -> Plant: typed, SI, names and dimensions checked
    link,  # -> Network: junction balances, sums, readings across modules
    derive_residuals,  # -> Residuals: pairs of estimates that must agree
    differentiate,  # -> Models: symbolic work, once per module type
    assemble,  # -> Assembly: the equations of the plant as one graph
    derive_signatures,  # -> Signatures: fault-symptom matrix at the reference point
    derive_rules,  # -> Rules: degrees with uncertainties
    analyse_isolability,  # -> Isolability: what cannot be told apart
    order_equations,  # -> Ordered: what a simulation solves, and in which order
    put_balances,  # -> Balanced: the balances of what stores, as one plan
    emit,  # -> Ruleset: data for the runtime
)


def run_passes(start: Any, passes: tuple[Callable[[Any], Any], ...] = PASSES) -> Any:
    """Run passes one after the other; raises `Refused` with all mistakes of the first bad one."""
    result = start
    with without_collector():
        for step in passes:
            result = step(result)
    return result


@contextmanager
def without_collector() -> Iterator[None]:
    """No search for garbage: tables live to the end, and walking them takes a third of the time."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def up_to(name: str) -> tuple[Callable[[Any], Any], ...]:
    """The passes from the first to the named one."""
    names = [p.__name__ for p in PASSES]
    return PASSES[: names.index(name) + 1]


def compile_plant(path: Path) -> Ruleset:
    """Compile a plant folder or file; raises `Refused` with all mistakes of the first bad pass."""
    ruleset: Ruleset = run_passes(path)
    return ruleset
