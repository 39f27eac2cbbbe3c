"""Which readings of a plant follow from its equations, and which have to be given.

Unknown are the flows of modules and the readings that are not inputs. Where there are more
unknowns than equations, some readings are given instead, like inputs: flows count as unknown
first, then at each turn the reading that moves the disagreement of the estimates most, at the
reference point, in a way that no reading before could. So a power that one estimate hangs on is
predicted, and a temperature that touches several lightly drives them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from runtime.equations import Equations, SimulationRefused
from runtime.matching import match, surplus
from runtime.operating_points import OperatingPoints
from runtime.plan import Array
from runtime.ruleset import Ruleset

VANISHED = 1e-9
"""Share of a flow below which a reading moves nothing any more."""


def equations_of(ruleset: Ruleset) -> Equations:
    """Find what is unknown, and what has to be given.

    Raises
    ------
    SimulationRefused
        Some observers over-determine their readings: a healthy plant obeys them only by chance.
    """
    used = {s for o in ruleset.observers for s in o.signals}
    flows = tuple(m for m in ruleset.modules if any(o.module == m for o in ruleset.observers))
    balances = _balances_between(ruleset, flows)
    loose = Equations(
        ruleset,
        tuple(s.id for s in ruleset.signals if s.id in used and not s.is_input),
        tuple(s.id for s in ruleset.signals if s.id in used and s.is_input),
        flows,
        balances,
    )
    readers = _readers(loose)
    order = [*range(len(flows)), *(len(flows) + i for i in _by_strength(loose))]
    partner = match([readers[i] for i in order])
    equations = len(ruleset.observers) + len(balances)
    many, unknowns = surplus([readers[i] for i in order], partner, equations)
    if many:
        raise SimulationRefused(_over_determined(loose, many, [order[i] for i in unknowns]))
    names = [*flows, *loose.predicted]
    free = {names[i] for i, own in zip(order, partner, strict=True) if own is None}
    return Equations(
        ruleset,
        tuple(name for name in loose.predicted if name not in free),
        tuple(s.id for s in ruleset.signals if s.id in {*loose.given, *free}),
        flows,
        balances,
    )


def _readers(loose: Equations) -> list[list[int]]:
    """Equations (observers, then balances) that hold each unknown (flows, then readings)."""
    observers, flows = loose.ruleset.observers, range(len(loose.flows))
    readers = [np.flatnonzero(loose.module_of == j).tolist() for j in flows]
    for j in flows:
        readers[j] += (len(observers) + np.flatnonzero(loose.balances[:, j])).tolist()
    return readers + [
        [i for i, o in enumerate(observers) if name in o.signals] for name in loose.predicted
    ]


def _by_strength(loose: Equations) -> list[int]:
    """Numbers of the readings, the one that moves the estimates most first.

    Source: orthogonalisation with column pivoting (Businger and Golub 1965), flows first.
    """
    given = {s.id: np.array([s.reference]) for s in loose.given_signals}
    point = OperatingPoints(loose, given, {}, np.zeros((len(loose.ruleset.observers), 1)))
    share, index = np.zeros(1), np.zeros(1, dtype=int)
    slopes = np.nan_to_num(point.jacobian(loose.start[None], share, index)[0])
    readings = len(loose.predicted)
    basis, _ = np.linalg.qr(slopes[:, readings:])
    rest = slopes[:, :readings] - basis @ (basis.T @ slopes[:, :readings])
    order: list[int] = []
    for _ in range(readings):
        # Rounded: where two move equally much, the first counts on every machine.
        sizes = np.round(np.linalg.norm(rest, axis=0), 9)
        sizes[order] = -1.0
        order.append(int(np.argmax(sizes)))
        if sizes[order[-1]] > VANISHED:
            direction = rest[:, order[-1]] / np.linalg.norm(rest[:, order[-1]])
            rest = rest - np.outer(direction, direction @ rest)
    return order


def _over_determined(loose: Equations, many: Sequence[int], unknowns: Sequence[int]) -> str:
    observers = [loose.ruleset.observers[i].id for i in many if i < len(loose.module_of)]
    readings = [loose.predicted[i - len(loose.flows)] for i in unknowns if i >= len(loose.flows)]
    free = f"only {', '.join(readings)} and the flows" if readings else "only the flows"
    return (
        f"{loose.ruleset.plant} cannot be simulated: {', '.join(observers)} and the junctions "
        f"between them are more equations than unknowns ({free} can follow). Each observer too "
        "many needs a reading of its own that is not 'input: true'"
    )


def _balances_between(ruleset: Ruleset, flows: Sequence[str]) -> Array:
    """Independent balances among the modules in `flows`; flows of all others are eliminated."""
    others = [m for m in ruleset.modules if m not in flows]
    column = {name: i for i, name in enumerate([*others, *flows])}
    matrix = np.zeros((len(ruleset.junctions), len(column)))
    for row, junction in zip(matrix, ruleset.junctions, strict=True):
        for name in junction.outlets:
            row[column[name]] += 1.0
        for name in junction.inlets:
            row[column[name]] -= 1.0
    return _eliminated(matrix, len(others))[:, len(others) :]


def _eliminated(matrix: Array, first: int) -> Array:
    """Independent rows without entries in the first columns (Gauss, with pivoting)."""
    rest, done = matrix.copy(), 0
    kept = 0
    for j in range(matrix.shape[1]):
        if done == len(rest):
            break
        pivot = done + int(np.argmax(np.abs(rest[done:, j])))
        if abs(rest[pivot, j]) < 1e-9:
            continue
        rest[[done, pivot]] = rest[[pivot, done]]
        rest[done + 1 :] -= np.outer(rest[done + 1 :, j] / rest[done, j], rest[done])
        done += 1
        kept += j < first
    return rest[kept:done]
