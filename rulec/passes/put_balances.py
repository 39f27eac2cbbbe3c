"""Pass 11, put balances: the balances of stored quantities, as one plan for the integrator.

Faults that act on them are built in, each with a degree that is 0 without the fault.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import sympy
from rulec_runtime.contract.ruleset import Dynamics, StateSpec

from rulec.knowledge.knowledge import FaultType, Knowledge, SensorClass, Variant
from rulec.knowledge.module_type import ENDS, OUTFLOW, FaultUse, ModuleType, Parameter
from rulec.knowledge.plant import Module
from rulec.language.diagnostics import Diagnostic, Origin, Refused
from rulec.language.expression import Expression, Rejected, parse
from rulec.language.units import NONE, Unit
from rulec.limits import ASSUMED_ACCURACY
from rulec.passes.amend import Amended, Change, amend
from rulec.passes.differentiate import fault_names, healthy, law_of
from rulec.passes.link import Network
from rulec.passes.lower import Lowering, form_of, lower_states, parameter_id


@dataclass(frozen=True)
class Balanced:
    """The balances of a plant, None if it stores nothing; `faults` are those they can show."""

    dynamics: Dynamics | None
    faults: tuple[StoreFault, ...] = ()


def put_balances(network: Network) -> Balanced:
    """Lower the balances of the plant.

    >>> from rulec.passes.pipeline import example
    >>> example("balanced").balanced.dynamics is None
    True
    >>> example("balanced", "cascaded-tanks").balanced.dynamics.inputs
    ('pump.u',)
    """
    if not network.stores:
        return Balanced(None)
    plant = network.plant
    faults = {m.name: store_faults(m, plant.knowledge) for m in plant.modules.values()}
    dynamics = dynamics_of(network, faults)
    built = set(dynamics.faults)
    return Balanced(dynamics, tuple(f for own in faults.values() for f in own if f.id in built))


def dynamics_of(network: Network, faults: Mapping[str, list[StoreFault]]) -> Dynamics:
    """The balances of a plant that stores, with the faults of each module built in.

    Raises `Refused` (KB115) if a flow depends on itself.
    """
    plant = network.plant
    modules = plant.modules.values()
    sensors = plant.knowledge.sensors
    amended = {m.name: _with_errors(m, with_faults(m, faults[m.name]), sensors) for m in modules}
    laws = {
        (m.name, group.removesuffix("s"), law): accuracy.share if accuracy else ASSUMED_ACCURACY
        for m in modules
        for (group, law), accuracy in m.type.laws().items()
    }
    shifts = {place: form_of(place[0], place[2]) for place in laws}
    try:
        plan = lower_states(Lowering(network, amended, shifts, network.ends))
    except Rejected as error:
        raise Refused([Diagnostic(plant.place, error.code, error.message, error.hint)]) from None
    parameters = {parameter_id(m, p.name): p for m in modules for p in m.parameters.values()}
    used = {n: p for n, p in parameters.items() if n in plan.used_inputs}
    moved = plan.select(n for n in plan.outputs if n.partition(":")[0] not in ENDS).used_inputs
    return Dynamics(
        states=tuple(
            StateSpec(
                f"{m.name}.{s.name}",
                f"{s.title} of {m.title}",
                s.unit.text,
                s.unit.factor,
                s.unit.offset,
            )
            for m in modules
            for s in m.type.states.values()
        ),
        inputs=tuple(name for name in plant.signals if name in plan.used_inputs),
        outputs=tuple(name for name in plant.signals if f"shown:{name}" in plan.outputs),
        faults=tuple(f.id for m in modules for f in faults[m.name] if f.degree in moved),
        values={name: p.value for name, p in used.items()},
        uncertainties={name: p.u for name, p in used.items()},
        forms={
            f"{module}.{law}": 0.5 * share
            for (module, _, law), share in laws.items()
            if share and form_of(module, law) in moved
        },
        plan=plan,
    )


# Faults of a plant that stores, built into its balances with a degree each. Balances run from
# states to what sensors show. So a fault of a flow, of a law that uses a state, or of what a sensor
# shows acts by its own law. Faults of given readings and of observers are undone, as in settled
# modules, because there the equations start from readings.

ORDER = ("definition", "observer", "signal", "reading", "end")
"""Kinds of places in the order in which laws are built in; flows at ends follow all their laws."""

Places = tuple[tuple[str, str], ...]
"""Places of a module type, as (kind, name)."""


@dataclass(frozen=True, kw_only=True)
class StoreFault:
    """A fault of a module; `settled` if the equations without time have it too."""

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
    # Faults of both have the names that the settled equations give them.
    named = _names(kind, knowledge) | _names(still, knowledge)
    result = []
    for (use, _), (variant, name) in named.items():
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
    """A fault as a change of its module type, with the plan input `degree`."""
    unit = Unit("1", 1.0, NONE)
    x = Parameter(name="x", value=0.0, unit=unit, title=variant.meaning, origin=fault.origin)
    return Change(places=places, law=law, parameters={"x": x}, ids={"x": degree})


def _names(
    kind: ModuleType, knowledge: Knowledge
) -> dict[tuple[FaultUse, str], tuple[Variant, str]]:
    """Variants of faults with their local ids, by the use and the name of the variant."""
    named = fault_names(kind.faults, knowledge, kind.signals)
    return {(use, variant.name): (variant, name) for use, variant, name in named}


def with_faults(module: Module, faults: list[StoreFault]) -> Amended:
    """The type of a module with all of its faults built in, without effect at degree 0."""
    result = Amended(type=module.type)
    for fault in sorted(faults, key=lambda f: ORDER.index(f.change.places[0][0])):
        result = amend(result, fault.change)
    return result


def _with_errors(module: Module, amended: Amended, sensors: Mapping[str, SensorClass]) -> Amended:
    """The type of a module with an error of each given reading, inside its faults: a faulty sensor
    scales its errors as well. The error of a class that states a share of the reading is a share:
    a meter whose pump stands is not off."""
    unit = Unit("1", 1.0, NONE)
    e = Parameter(name="e", value=0.0, unit=unit, title="error", origin=Origin("", 0))
    for signal in (s for n, s in module.type.signals.items() if n not in module.type.readings):
        name, law = f"{module.name}.{signal.name}", "law - e"
        ids = {"e": f"error.{name}"}
        if sensors[signal.sensor].kind == "reading":
            ids, law = {"e": f"share.{name}"}, f"law - e*(law - {signal.unit.offset})"
        places = (("signal", signal.name),)
        change = Change(places=places, law=parse(law), parameters={"e": e}, ids=ids)
        amended = amend(amended, change)
    return amended


def _acting(
    module: Module, fault: FaultType, variant: Variant, target: str
) -> tuple[Places, Expression]:
    """The places that a fault changes, and its law there."""
    kind = module.type
    if fault.acts_on == "flow":
        components = kind.components()
        if target in components:
            return tuple(("observer", o) for o in components[target]), forward_law(variant)
        assert target in ENDS
        # The modules downstream determine the outflow, so they get its faulty value.
        law = inverse_law(variant, "end") if target == OUTFLOW else forward_law(variant)
        return (("end", target),), law
    if fault.acts_on == "signal" and target in kind.readings:
        return (("reading", target),), forward_law(variant)
    still = target in kind.signals or target in kind.settled().definitions
    law = inverse_law(variant, fault.acts_on) if still else forward_law(variant)
    return ((fault.acts_on, target),), law


@functools.lru_cache(maxsize=100)
def inverse_law(variant: Variant, acts_on: str) -> Expression:
    """The healthy value, over ``law`` (the faulty value) and the degree ``x``; see `healthy`."""
    return parse(sympy.sstr(healthy(variant, acts_on, _LAW, _DEGREE)))


@functools.lru_cache(maxsize=100)
def forward_law(variant: Variant) -> Expression:
    """The faulty value, over ``law`` (the healthy value) and the degree ``x``."""
    return parse(sympy.sstr(law_of(variant, _LAW, _DEGREE)))


_LAW, _DEGREE = (sympy.Symbol(name, real=True) for name in ("law", "x"))
