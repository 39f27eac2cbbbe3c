"""The reference point: a fault-free operating point near the readings that the files state.

Newton steps of least length, each reading in its own scale, continue until all observers of a
module give the same flow and the flows balance. Speeds and other inputs stay fixed.
"""

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg
from rulec_runtime.contract.plan import Array, Plan

from rulec.language.diagnostics import Diagnostic, Refused
from rulec.passes.assemble import MODEL, PARAMETERS, Assembly
from rulec.passes.derive_residuals import Residual
from rulec.passes.limits import (
    FLOW_COST,
    REFERENCE_DAMPING,
    REFERENCE_HALVINGS,
    REFERENCE_STEP,
    REFERENCE_STEPS,
    SADDLE_RIDGE,
    VANISHED_RESIDUAL,
)
from rulec.passes.link import Network


def solve_reference(
    network: Network, residuals: tuple[Residual, ...], assembly: Assembly
) -> dict[str, float]:
    """Readings (SI) at which all residuals vanish.

    Raises `Refused` (KB088) if no such point is found near the given readings.
    """
    readings, free = _start(network, assembly)
    if not assembly.observers:
        return readings
    plan, slopes = _plan(assembly, free)
    scale = np.array([abs(readings[s]) or 1.0 for s in free])
    values = plan.run(_inputs(readings))
    stated = {o: float(values[f"q:{o}"][0]) for o in assembly.observers}
    for _ in range(REFERENCE_STEPS):
        q = {o: float(values[f"q:{o}"][0]) for o in assembly.observers}
        if not np.isfinite([*q.values()]).all():
            break
        change = _step(network, free, q, {at: values[n][0] for n, at in slopes.items()}, scale)
        size = float(np.max(np.abs(change), initial=0))
        if size < REFERENCE_STEP and _agree(residuals, q):
            return readings
        damping = min(1.0, REFERENCE_DAMPING / max(size, 1e-300))
        for halving in range(REFERENCE_HALVINGS):
            step = (change * scale * damping / 2.0**halving).tolist()
            tried = {**readings, **{s: readings[s] + d for s, d in zip(free, step, strict=True)}}
            values = plan.run(_inputs(tried))
            if all(np.isfinite(values[f"q:{o}"][0]) for o in assembly.observers):
                break
        readings = tried
    message = "no fault-free operating point was found near the reference readings"
    hint = f"{_misfit(residuals, stated)}; check units, and the 'reference' of each signal"
    raise Refused([Diagnostic(network.plant.place, "KB088", message, hint)])


def _misfit(residuals: tuple[Residual, ...], stated: Mapping[str, float]) -> str:
    """What fits least at the readings as given, in words."""
    undefined = [o for o, flow in stated.items() if not np.isfinite(flow)]
    if undefined:
        return f"there {' and '.join(undefined)} cannot be calculated: a root or a division fails"

    worst, apart = "the flows balance", 1.0
    for residual in residuals:
        sides = [[o for sign, o in residual.terms if sign == side] for side in (1, -1)]
        flows = [sum(stated[o] for o in names) for names in sides]
        less, more = sorted(map(abs, flows))
        ratio = more / less if flows[0] * flows[1] > 0 else np.inf
        if ratio > apart:
            told = [f"{' + '.join(n)} {3600 * f:.3g}" for n, f in zip(sides, flows, strict=True)]
            worst, apart = f"{' and '.join(told)} m3/h should be equal", ratio
    return f"there {worst}"


def _agree(residuals: tuple[Residual, ...], q: Mapping[str, float]) -> bool:
    """Whether all residuals vanish; if no reading may move, a zero step does not imply this."""
    left = [abs(sum(s * q[o] for s, o in r.terms)) for r in residuals]
    return max(left, default=0.0) <= VANISHED_RESIDUAL * max(map(abs, q.values()))


def _start(network: Network, assembly: Assembly) -> tuple[dict[str, float], list[str]]:
    """Reference readings as given, and the names of those that may move."""
    readings, free = {}, []
    used = {name for gradient in assembly.gradients.values() for name in gradient}
    for module in network.plant.modules.values():
        for signal in module.type.signals.values():
            key = f"{module.name}.{signal.name}"
            readings[key] = module.reference.get(signal.name, np.nan)
            if key in used:
                if np.isnan(readings[key]):
                    low, high = signal.lowest, signal.highest
                    readings[key] = 1.0 if low is None or high is None else (low + high) / 2
                if not signal.is_input:
                    free.append(key)
    return readings, free


def _plan(assembly: Assembly, free: list[str]) -> tuple[Plan, dict[str, tuple[str, str]]]:
    """Plan of all observers and their derivatives by the free readings, with names of these."""
    outputs = {f"q:{o}": node for o, node in assembly.observers.items()}
    names, movable = {}, set(free)
    for observer, gradient in assembly.gradients.items():
        for signal, node in gradient.items():
            if signal in movable:
                name = f"s:{observer}:{signal}"
                outputs[name] = node
                names[name] = (observer, signal)
    return assembly.graph.plan(outputs), names


def _inputs(readings: Mapping[str, float]) -> dict[str, float]:
    """Readings with unit uncertainties, so that scaled derivatives become plain ones."""
    return {**readings, **{f"u:{s}": 1.0 for s in readings}, PARAMETERS: 1.0, MODEL: 1.0}


def _step(
    network: Network,
    free: list[str],
    q: Mapping[str, float],
    slopes: Mapping[tuple[str, str], float],
    scale: Array,
) -> Array:
    """Change of the free readings, in their scales, of least length that makes all flows agree.

    Unknowns are these changes and the flow of each module; flows have almost no cost.
    """
    column = {name: i for i, name in enumerate([*free, *network.plant.modules])}
    row = {observer: i for i, observer in enumerate(q)}
    entries = [(i, column[o.partition(".")[0]], -1.0) for o, i in row.items()]
    entries += [(row[o], column[s], slope * scale[column[s]]) for (o, s), slope in slopes.items()]
    for j, balance in enumerate(network.balances, len(q)):
        entries += [(j, column[name], 1.0) for name in balance.outlets]
        entries += [(j, column[name], -1.0) for name in balance.inlets]
    rows, columns, numbers = zip(*entries, strict=True)
    equations = len(q) + len(network.balances)
    jacobian = sparse.csc_matrix((numbers, (rows, columns)), (equations, len(column)))
    typical = float(np.median(np.abs([*q.values()]))) or 1.0
    weights = np.full(len(column), FLOW_COST / typical)
    weights[: len(free)] = typical
    ridge = sparse.diags(np.full(equations, -SADDLE_RIDGE))
    system = sparse.bmat([[sparse.diags(weights), jacobian.T], [jacobian, ridge]], format="csc")
    right = np.zeros(len(column) + equations)
    right[len(column) : len(column) + len(q)] = [-flow for flow in q.values()]
    change: Array = linalg.spsolve(system, right)[: len(free)]
    return change
