"""Faults of a plant that stores, built into its balances with a degree each.

Balances run from what is stored to what sensors show, so a fault of a flow, of a law that rests on
a state or of what is shown acts as its own law says. What settled modules have, a reading that is
given or an observer, is undone as everywhere: there the equations start from readings.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import sympy

from rulec.knowledge.knowledge import FaultType, Knowledge, Variant
from rulec.knowledge.module_type import ENDS, OUTFLOW, FaultUse, ModuleType, Parameter
from rulec.knowledge.plant import Module
from rulec.language.expression import Expression, parse
from rulec.language.invert import invert
from rulec.language.units import NONE, Unit
from rulec.passes.amend import Amended, Change, amend
from rulec.passes.differentiate import fault_names, law_of

ORDER = ("definition", "observer", "signal", "reading", "end")
"""Kinds of places in the order in which laws are built in: what flows is behind all laws of it."""


Places = tuple[tuple[str, str], ...]
"""Places of a module type, as (kind, name)."""


@dataclass(frozen=True, kw_only=True)
class StoreFault:
    """A fault of a module; `settled`: the equations without time have it as well."""

    id: str
    module: str
    fault: FaultType
    variant: Variant
    target: str
    settled: bool
    change: Change

    @property
    def degree(self) -> str:
        """Plan input of its degree."""
        return f"x.{self.id}"


def store_faults(module: Module, knowledge: Knowledge) -> list[StoreFault]:
    """All faults of a module, as changes of its type."""
    kind, still = module.type, module.type.settled()
    named = dict(_named(kind, knowledge))
    # What both know has the name that the settled equations give it.
    named |= dict(_named(still, knowledge))
    result = []
    for (use, variant), name in named.items():
        fault, id_ = knowledge.fault_in(use), f"{module.name}.{name}"
        places, law = _acting(module, fault, variant, use.target)
        result.append(
            StoreFault(
                id=id_,
                module=module.name,
                fault=fault,
                variant=variant,
                target=f"{module.name}.{use.target}",
                settled=use in still.faults,
                change=fault_change(fault, variant, places, law, f"x.{id_}"),
            )
        )
    return result


def fault_change(
    fault: FaultType, variant: Variant, places: Places, law: Expression, degree: str
) -> Change:
    """A fault as a change of its module type; `degree` is the plan input of its degree."""
    unit = Unit("1", 1.0, NONE)
    x = Parameter(name="x", value=0.0, unit=unit, title=variant.meaning, origin=fault.origin)
    return Change(places=places, law=law, parameters={"x": x}, ids={"x": degree})


def _named(
    kind: ModuleType, knowledge: Knowledge
) -> Iterator[tuple[tuple[FaultUse, Variant], str]]:
    for use, variant, name in fault_names(kind.faults, knowledge, kind.signals):
        yield (use, variant), name


def with_faults(module: Module, faults: list[StoreFault]) -> Amended:
    """The type of a module with all of its faults built in; without degrees it is as before."""
    result = Amended(type=module.type)
    for fault in sorted(faults, key=lambda f: ORDER.index(f.change.places[0][0])):
        result = amend(result, fault.change)
    return result


def _acting(
    module: Module, fault: FaultType, variant: Variant, target: str
) -> tuple[Places, Expression]:
    """The places that a fault changes, and the law that it has there."""
    kind = module.type
    if fault.acts_on == "flow":
        components = kind.components()
        if target in components:
            return tuple(("observer", o) for o in components[target]), doing(variant)
        assert target in ENDS
        # What leaves is set by what lies behind: that gets what the fault leaves of it.
        law = undoing(variant, "end") if target == OUTFLOW else doing(variant)
        return (("end", target),), law
    if fault.acts_on == "signal" and target in kind.readings:
        return (("reading", target),), doing(variant)
    still = target in kind.signals or target in kind.settled().definitions
    law = undoing(variant, fault.acts_on) if still else doing(variant)
    return ((fault.acts_on, target),), law


@functools.lru_cache(maxsize=100)
def undoing(variant: Variant, acts_on: str) -> Expression:
    """What should be there, over ``law`` (what is there) and the degree ``x``.

    A flow fault takes away behind the observer, whose flow is what should be there.
    """
    if acts_on == "flow":
        return doing(variant)
    g, x, law = (sympy.Symbol(name, real=True) for name in ("g", "x", "law"))
    solved = invert(law_of(variant, g, x), g, law)
    assert solved is not None, "checked when the fault was read"
    return parse(sympy.sstr(solved))


@functools.lru_cache(maxsize=100)
def doing(variant: Variant) -> Expression:
    """What is there, over ``law`` (what should be there) and the degree ``x``."""
    x, law = (sympy.Symbol(name, real=True) for name in ("x", "law"))
    return parse(sympy.sstr(law_of(variant, law, x)))
