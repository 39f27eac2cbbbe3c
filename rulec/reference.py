"""The reference point: a fault-free operating point near the readings that the files name.

Newton steps of least length, each reading in its own scale, until every observer of a module
gives the same flow and the flows balance. Speeds and other inputs stay where they are.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg as linalg

from rulec.assemble import MODEL, PARAMETERS, Assembly
from rulec.language.diagnostics import Diagnostic, Refused
from rulec.link import Network
from runtime.plan import Array, Plan

STEPS = 40
FREE = 1e-14
"""Cost of a flow over that of a reading, each in its own scale: the step must be unique."""

VANISHED = 1e-6
"""Share of the largest flow below which a residual counts as zero."""


def solve_reference(assembly: Assembly) -> dict[str, float]:
    """Readings (SI) at which all residuals vanish.

    Raises `Refused` (KB088) where no such point is found near the given readings.
    """
    network = assembly.residuals.network
    readings, free = _start(assembly)
    plan, names = _plan(assembly, free)
    observers = list(assembly.observers)
    if not observers:
        return readings
    scale = np.array([abs(readings[s]) or 1.0 for s in free])
    size = np.inf
    for _ in range(STEPS):
        values = plan.run(_inputs(readings))
        q = np.array([values[f"q:{o}"][0] for o in observers])
        if not np.all(np.isfinite(q)):
            break
        slopes = {pair: values[name][0] for name, pair in names.items()}
        step = _step(network, observers, free, q, slopes, scale)
        damping = min(1.0, 0.3 / max(float(np.max(np.abs(step / scale), initial=0)), 1e-300))
        for name, change in zip(free, step, strict=True):
            readings[name] += damping * float(change)
        size = float(np.max(np.abs(step / scale), initial=0))
        if size < 1e-12:
            break
    if size < 1e-9 and _agree(assembly, q):
        return readings
    message = "no fault-free operating point was found near the reference readings"
    hint = "give each module 'reference: {...}' with readings that fit together"
    raise Refused([Diagnostic(network.plant.place, "KB088", message, hint)])


def _agree(assembly: Assembly, flows: Array) -> bool:
    """Do all residuals vanish? Where no reading may move, no step does not mean no residual."""
    q = dict(zip(assembly.observers, flows, strict=True))
    left = [abs(sum(s * q[o] for s, o in r.terms)) for r in assembly.residuals.residuals]
    return max(left, default=0.0) <= VANISHED * float(np.max(np.abs(flows), initial=0.0))


def _start(assembly: Assembly) -> tuple[dict[str, float], list[str]]:
    """Reference readings as given, and the names of those that may move."""
    readings, free = {}, []
    used = {name for gradient in assembly.gradients.values() for name in gradient}
    for module in assembly.residuals.network.plant.modules.values():
        for signal in module.type.signals.values():
            key = f"{module.name}.{signal.name}"
            readings[key] = module.reference.get(signal.name, np.nan)
            if key in used:
                if np.isnan(readings[key]):
                    readings[key] = _middle(signal.lowest, signal.highest)
                if not signal.is_input:
                    free.append(key)
    return readings, free


def _middle(low: float | None, high: float | None) -> float:
    return 1.0 if low is None or high is None else (low + high) / 2


def _plan(assembly: Assembly, free: list[str]) -> tuple[Plan, dict[str, tuple[str, str]]]:
    """Plan of all observers and their derivatives by the free readings."""
    graph = assembly.graph
    outputs = {f"q:{o}": node for o, node in assembly.observers.items()}
    names = {}
    movable = set(free)
    for observer, gradient in assembly.gradients.items():
        for signal, node in gradient.items():
            if signal in movable:
                name = f"s:{observer}:{signal}"
                outputs[name] = node
                names[name] = (observer, signal)
    return graph.plan(outputs), names


def _inputs(readings: Mapping[str, float]) -> dict[str, float]:
    """Readings with unit uncertainties: scaled derivatives become plain ones."""
    return {**readings, **{f"u:{s}": 1.0 for s in readings}, PARAMETERS: 1.0, MODEL: 1.0}


def _step(
    network: Network,
    observers: list[str],
    free: list[str],
    q: Array,
    slopes: Mapping[tuple[str, str], float],
    scale: Array,
) -> Array:
    """Least-length change of the free readings that makes all flows agree.

    Unknowns are the changes (scaled) and the flow of each module; the flows carry no cost.
    """
    modules = {name: i for i, name in enumerate(network.plant.modules)}
    column = {s: i for i, s in enumerate(free)}
    row = {o: i for i, o in enumerate(observers)}
    rows, columns, entries, right = [], [], [], []
    for i, observer in enumerate(observers):
        rows.append(i)
        columns.append(len(free) + modules[observer.split(".")[0]])
        entries.append(-1.0)
        right.append(-q[i])
    for (observer, signal), slope in slopes.items():
        rows.append(row[observer])
        columns.append(column[signal])
        entries.append(slope * scale[column[signal]])
    for j, balance in enumerate(network.balances, len(observers)):
        for sign, names in ((1.0, balance.outlets), (-1.0, balance.inlets)):
            for name in names:
                rows.append(j)
                columns.append(len(free) + modules[name])
                entries.append(sign)
        right.append(0.0)
    flow = float(np.median(np.abs(q))) or 1.0
    unknowns, equations = len(free) + len(modules), len(right)
    jacobian = sparse.csc_matrix((np.array(entries), (rows, columns)), (equations, unknowns))
    weights = np.concatenate([np.full(len(free), flow), np.full(len(modules), FREE / flow)])
    system = sparse.bmat(
        [
            [sparse.diags(weights), jacobian.T],
            [jacobian, sparse.diags(np.full(equations, -1e-14))],
        ],
        format="csc",
    )
    solution = linalg.spsolve(system, np.concatenate([np.zeros(unknowns), right]))
    change: Array = solution[: len(free)] * scale
    return change
