"""Pass 11, put balances: the balances of stored quantities, as one plan for the integrator.

Faults that act on them are built in, each with a degree that is 0 without the fault.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Dynamics, StateSpec

from rulec.knowledge.module_type import ENDS
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.language.expression import Rejected
from rulec.passes.link import Network
from rulec.passes.lower import Lowering, lower_states, parameter_id
from rulec.passes.store_faults import StoreFault, store_faults, with_faults


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
    kept = set(dynamics.faults)
    return Balanced(dynamics, tuple(f for own in faults.values() for f in own if f.id in kept))


def dynamics_of(network: Network, faults: Mapping[str, list[StoreFault]]) -> Dynamics:
    """The balances of a plant that stores, with the faults of each module built in.

    Raises `Refused` (KB115) if a flow depends on itself.
    """
    plant = network.plant
    modules = plant.modules.values()
    amended = {m.name: with_faults(m, faults[m.name]) for m in modules}
    try:
        plan = lower_states(Lowering(network, amended, {}, network.ends))
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
        plan=plan,
    )
