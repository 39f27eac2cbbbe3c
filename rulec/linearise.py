"""The plant in numbers at its reference point: how estimates follow errors and faults.

Everything is first order. From these tables any set of estimates can be judged, also with sensors
that are not there yet.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy

from rulec.derive_signatures import Signatures, reference_inputs
from rulec.differentiate import G
from rulec.graph import Graph
from runtime.plan import Plan


@dataclass(frozen=True)
class Linearised:
    """Slopes at the reference point, SI.

    Attributes
    ----------
    gradients : per observer d(estimate)/d(input) times the input's standard uncertainty, m3/s.
    uncertainties : standard uncertainty of each reading, in its unit.
    effects : per fault d(estimate)/d(degree) of the observers it makes wrong, m3/s.
    shifts : per fault of a reading, d(reading)/d(degree), in the unit of the reading.
    targets : per fault of a reading, the reading.
    """

    gradients: Mapping[str, Mapping[str, float]]
    uncertainties: Mapping[str, float]
    effects: Mapping[str, Mapping[str, float]]
    shifts: Mapping[str, float]
    targets: Mapping[str, str]


def linearise(signatures: Signatures) -> Linearised:
    """Evaluate gradients and slopes at the reference point."""
    assembly = signatures.assembly
    outputs = {
        f"{observer}|{name}": node
        for observer, gradient in assembly.gradients.items()
        for name, node in gradient.items()
    }
    for key, target in assembly.targets.items():
        outputs[f"{key}|value"] = target.value
        outputs |= {f"{key}|d|{o}": node for o, node in target.slopes.items()}
    inputs = reference_inputs(assembly, signatures.reference)
    values = {k: float(v[0]) for k, v in assembly.graph.plan(outputs).run(inputs).items()}
    effects: dict[str, dict[str, float]] = {}
    shifts: dict[str, float] = {}
    onset = _Onset()
    for h in assembly.hypotheses:
        rule = h.fault.rule.onset
        if h.fault.fault.acts_on == "flow":
            effects[h.id] = {o: onset.at(rule, signatures.flows[o]) for o in h.affects}
            continue
        shift = onset.at(rule, values[f"{h.target}|value"])
        slopes = assembly.targets[h.target].slopes
        effects[h.id] = {o: shift * values[f"{h.target}|d|{o}"] for o in h.affects if o in slopes}
        if h.fault.fault.acts_on == "signal":
            shifts[h.id] = shift
    return Linearised(
        {
            observer: {name: values[f"{observer}|{name}"] for name in gradient}
            for observer, gradient in assembly.gradients.items()
        },
        {k.removeprefix("u:"): v for k, v in inputs.items() if k.startswith("u:") and "." in k},
        effects,
        shifts,
        {h.id: h.target for h in assembly.hypotheses if h.id in shifts},
    )


class _Onset:
    """Evaluates what a fault begins with; few laws, many modules."""

    def __init__(self) -> None:
        self._plans: dict[sympy.Expr, Plan] = {}

    def at(self, onset: sympy.Expr, g: float) -> float:
        plan = self._plans.get(onset)
        if plan is None:
            graph = Graph(["g"])
            plan = graph.plan({"onset": graph.lower(onset, {G: graph.input("g")})})
            self._plans[onset] = plan
        return float(plan.run({"g": g})["onset"][0])
