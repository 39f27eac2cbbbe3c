"""Pass 11, put balances: what modules store, as one plan for the integrator.

Faults that act on what a state moves are built in with a degree each, which is 0 without them.
"""

from __future__ import annotations

from dataclasses import dataclass

from rulec.language.diagnostics import Diagnostic, Refused
from rulec.language.expression import Rejected
from rulec.link import Network
from rulec.lower import Lowering, lower_states, parameter_id
from rulec.order_equations import Ordered
from runtime.ruleset import Dynamics, StateSpec


@dataclass(frozen=True)
class Balanced:
    """What the passes before found, and the balances; None where nothing is stored."""

    ordered: Ordered
    dynamics: Dynamics | None


def put_balances(ordered: Ordered) -> Balanced:
    """Lower the balances of the plant."""
    signatures = ordered.isolability.rules.signatures
    network = signatures.assembly.residuals.network
    return Balanced(ordered, dynamics_of(network) if network.stores else None)


def dynamics_of(network: Network) -> Dynamics:
    """The balances of a plant that stores; raises `Refused` (KB115) for a flow in a circle."""
    plant = network.plant
    try:
        plan = lower_states(Lowering(network, {}, {}, network.ends))
    except Rejected as error:
        raise Refused([Diagnostic(plant.place, error.code, error.message, error.hint)]) from None
    modules = plant.modules.values()
    signals = [f"{m.name}.{s}" for m in modules for s in m.type.signals]
    outputs = [name for name in signals if f"shown:{name}" in plan.outputs]
    values = {parameter_id(m, p.name): p.value for m in modules for p in m.parameters.values()}
    return Dynamics(
        tuple(
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
        tuple(name for name in signals if name in plan.used_inputs),
        tuple(outputs),
        (),
        {name: value for name, value in values.items() if name in plan.used_inputs},
        plan,
    )
