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
    plan, names = _plan(assembly, free)
    found = _solved(network, residuals, assembly, plan, names, readings, free)
    if found is not None:
        return found
    message = "no fault-free operating point was found near the reference readings"
    hint = "give each module 'reference: {...}' with readings that fit together"
    raise Refused([Diagnostic(network.plant.place, "KB088", message, hint)])


def _solved(
    network: Network,
    residuals: tuple[Residual, ...],
    assembly: Assembly,
    plan: Plan,
    names: Mapping[str, tuple[str, str]],
    readings: dict[str, float],
    free: list[str],
) -> dict[str, float] | None:
    """Newton steps from some readings; None if they do not converge."""
    observers = list(assembly.observers)
    scale = np.array([abs(readings[s]) or 1.0 for s in free])
    values = plan.run(_inputs(readings))
    for _ in range(REFERENCE_STEPS):
        q = np.array([values[f"q:{o}"][0] for o in observers])
        if not np.all(np.isfinite(q)):
            return None
        slopes = {pair: values[name][0] for name, pair in names.items()}
        step = _step(network, observers, free, q, slopes, scale)
        size = float(np.max(np.abs(step / scale), initial=0))
        if size < REFERENCE_STEP and _agree(residuals, assembly, q):
            return readings
        damping = min(1.0, REFERENCE_DAMPING / max(size, 1e-300))
        for _ in range(REFERENCE_HALVINGS):
            tried = {**readings}
            for name, change in zip(free, step, strict=True):
                tried[name] += damping * float(change)
            values = plan.run(_inputs(tried))
            if all(np.isfinite(values[f"q:{o}"][0]) for o in observers):
                break
            damping /= 2.0
        readings = tried
    return None


def _agree(residuals: tuple[Residual, ...], assembly: Assembly, flows: Array) -> bool:
    """Whether all residuals vanish; if no reading may move, a zero step does not imply this."""
    q = dict(zip(assembly.observers, flows, strict=True))
    left = [abs(sum(s * q[o] for s, o in r.terms)) for r in residuals]
    return max(left, default=0.0) <= VANISHED_RESIDUAL * float(np.max(np.abs(flows), initial=0.0))


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
    observers: list[str],
    free: list[str],
    q: Array,
    slopes: Mapping[tuple[str, str], float],
    scale: Array,
) -> Array:
    """Change of the free readings of least length that makes all flows agree.

    Unknowns are the (scaled) changes and the flow of each module; flows have almost no cost.
    """
    modules = {name: i for i, name in enumerate(network.plant.modules)}
    column = {s: i for i, s in enumerate(free)}
    row = {o: i for i, o in enumerate(observers)}
    entries = [(i, len(free) + modules[o.partition(".")[0]], -1.0) for i, o in enumerate(observers)]
    entries += [
        (row[observer], column[signal], slope * scale[column[signal]])
        for (observer, signal), slope in slopes.items()
    ]
    for j, balance in enumerate(network.balances, len(observers)):
        entries += [(j, len(free) + modules[name], 1.0) for name in balance.outlets]
        entries += [(j, len(free) + modules[name], -1.0) for name in balance.inlets]
    rows, columns, numbers = zip(*entries, strict=True)
    right = np.concatenate([-q, np.zeros(len(network.balances))])
    flow = float(np.median(np.abs(q))) or 1.0
    unknowns, equations = len(free) + len(modules), len(right)
    jacobian = sparse.csc_matrix((numbers, (rows, columns)), (equations, unknowns))
    weights = np.concatenate([np.full(len(free), flow), np.full(len(modules), FLOW_COST / flow)])
    system = sparse.bmat(
        [
            [sparse.diags(weights), jacobian.T],
            [jacobian, sparse.diags(np.full(equations, -SADDLE_RIDGE))],
        ],
        format="csc",
    )
    solution = linalg.spsolve(system, np.concatenate([np.zeros(unknowns), right]))
    change: Array = solution[: len(free)] * scale
    return change
