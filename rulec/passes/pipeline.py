"""The order of the passes.

A pass is a function of the fields of the record that its parameters name, and returns one further
field. It changes no other field, except that the rules add outputs to the graph of the assembly.
"""

import functools
import gc
import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset

from rulec.knowledge.check_plant import check
from rulec.knowledge.layers import shipped
from rulec.knowledge.read import read_plant
from rulec.passes.analyse_isolability import analyse_isolability
from rulec.passes.assemble import assemble
from rulec.passes.derive_residuals import derive_residuals
from rulec.passes.derive_rules import derive_rules
from rulec.passes.derive_signatures import derive_signatures
from rulec.passes.differentiate import differentiate
from rulec.passes.emit import emit
from rulec.passes.invariants import check_invariants, checks_are_on
from rulec.passes.link import link
from rulec.passes.order_equations import order_equations
from rulec.passes.put_balances import put_balances
from rulec.passes.types import Compilation

PASSES: Mapping[str, Callable[..., Any]] = {
    "sources": read_plant,  # documents with positions, schema checked
    "plant": check,  # typed, SI, names and dimensions checked
    "network": link,  # junction balances, sums, readings across modules
    "residuals": derive_residuals,  # pairs of estimates that must agree
    "types": differentiate,  # symbolic work, once per module type
    "assembly": assemble,  # the equations of the plant as one graph
    "signatures": derive_signatures,  # fault-symptom matrix at the reference point
    "rules": derive_rules,  # degrees with uncertainties
    "isolability": analyse_isolability,  # what cannot be told apart
    "simulation": order_equations,  # what a simulation solves, and in which order
    "balanced": put_balances,  # the balances of what stores, as one plan
    "ruleset": emit,  # data for the runtime
}
"""Each pass by the field that it fills."""


def run_passes(models: Compilation, until: str = "ruleset") -> Compilation:
    """Run the passes that have not run, up to the one that fills the field `until`.

    Raises `Refused` with all mistakes of the first pass that finds any.
    """
    with without_collector():
        for field, step in PASSES.items():
            if getattr(models, field) is None:
                # A pass reads the fields named by its parameters without a default.
                parameters = inspect.signature(step).parameters.values()
                names = [p.name for p in parameters if p.default is inspect.Parameter.empty]
                parts = {name: getattr(models, name) for name in names}
                models = replace(models, **{field: step(**parts)})
                if checks_are_on():
                    check_invariants(field, models)
            if field == until:
                break
    return models


@contextmanager
def without_collector() -> Iterator[None]:
    """Disable garbage collection: tables live to the end, and traversing them costs a third."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@functools.cache
def example(until: str, plant: str = "abc") -> Compilation:
    """A shipped plant, compiled up to a field, for the examples of the passes."""
    return run_passes(Compilation(path=shipped("plants") / plant), until)


def compile_plant(path: Path) -> Ruleset:
    """Compile a plant folder or file; raises `Refused` with all mistakes of the first bad pass."""
    return run_passes(Compilation(path=path)).ruleset
