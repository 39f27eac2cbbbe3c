"""The plant linearised at its reference point: slopes of estimates by errors and faults.

From these tables any set of estimates can be judged, including those with additional sensors.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import sympy

from rulec.algebra.graph import Graph
from rulec.algebra.recipe import lower
from rulec.passes.assemble import Assembly
from rulec.passes.derive_signatures import Signatures, reference_inputs
from rulec.passes.differentiate import G
from rulec.passes.link import Network


@dataclass(frozen=True, kw_only=True)
class Linearised:
    """Slopes at the reference point, SI.

    Attributes
    ----------
    gradients : per observer d(estimate)/d(input) times the input's standard uncertainty, m3/s.
    flows : per observer its estimate, m3/s.
    uncertainties : standard uncertainty of each reading, in its unit.
    effects : per fault d(estimate)/d(degree, as a share) of the observers it makes wrong, m3/s.
    shifts : per fault of a reading, d(reading)/d(degree, as a share), in the unit of the reading.
    targets : per fault of a reading, the reading.
    """

    gradients: Mapping[str, Mapping[str, float]]
    flows: Mapping[str, float]
    uncertainties: Mapping[str, float]
    effects: Mapping[str, Mapping[str, float]]
    shifts: Mapping[str, float]
    targets: Mapping[str, str]


def linearise(network: Network, assembly: Assembly, signatures: Signatures) -> Linearised:
    """Evaluate gradients and slopes at the reference point."""
    outputs = {
        f"{observer}|{name}": node
        for observer, gradient in assembly.gradients.items()
        for name, node in gradient.items()
    }
    for key, target in assembly.targets.items():
        outputs[f"{key}|value"] = target.value
        outputs |= {f"{key}|d|{o}": node for o, node in target.slopes.items()}
    inputs = reference_inputs(network, signatures.reference)
    values = {k: float(v[0]) for k, v in assembly.graph.plan(outputs).run(inputs).items()}
    excesses = _excesses(assembly, signatures, values)
    effects: dict[str, dict[str, float]] = {}
    shifts: dict[str, float] = {}
    for h in assembly.hypotheses:
        excess, scale = excesses[h.fault.rule.onset], h.fault.variant.scale
        if h.fault.fault.acts_on == "flow":
            effects[h.id] = {o: excess[o] * scale for o in h.affects}
            continue
        shift, slopes = excess[h.target] * scale, assembly.targets[h.target].slopes
        effects[h.id] = {o: shift * values[f"{h.target}|d|{o}"] for o in h.affects if o in slopes}
        if h.fault.fault.acts_on == "signal":
            shifts[h.id] = shift
    return Linearised(
        gradients={
            observer: {name: values[f"{observer}|{name}"] for name in gradient}
            for observer, gradient in assembly.gradients.items()
        },
        flows=signatures.flows,
        uncertainties={
            k.removeprefix("u:"): v for k, v in inputs.items() if k.startswith("u:") and "." in k
        },
        effects=effects,
        shifts=shifts,
        targets={h.id: h.target for h in assembly.hypotheses if h.id in shifts},
    )


def _excesses(
    assembly: Assembly, signatures: Signatures, values: Mapping[str, float]
) -> dict[sympy.Expr, dict[str, float]]:
    """Excess per unit of degree, by onset and observer or target; each law is evaluated once."""
    scaled: dict[sympy.Expr, dict[str, float]] = {}
    for h in assembly.hypotheses:
        at = scaled.setdefault(h.fault.rule.onset, {})
        if h.fault.fault.acts_on == "flow":
            at |= {o: signatures.flows[o] for o in h.affects}
        else:
            at[h.target] = values[f"{h.target}|value"]
    result = {}
    for onset, at in scaled.items():
        graph = Graph(["g"])
        plan = graph.plan({"onset": lower(graph, onset, {G: graph.input("g")})})
        excess = plan.run({"g": np.array(list(at.values()))})["onset"]
        result[onset] = dict(zip(at, np.broadcast_to(excess, len(at)).tolist(), strict=True))
    return result
