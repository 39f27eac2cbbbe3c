"""The change of inputs that separates best, within limits: one input, or more where one is not
enough.

What separates is asked of a *measure*; so the search knows neither faults nor physics.

Source: the design that maximises the smallest expected log Bayes factor, after Box and Hill 1967.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec import limits
from rulec.separation.allowed import Allowed

Point = Mapping[str, float]
"""Inputs that differ from the present point, as their sensors show them."""


@dataclass(frozen=True)
class Looked:
    """What a measure says of n points, each together with the present one.

    `apart` has a row for each pair of faults, shape (rows, n), standard deviations; NaN where the
    plant cannot be. `flows` per module, m3/s, shape (n,).
    """

    apart: Array
    flows: Mapping[str, Array]


Measure = Callable[[Sequence[Point]], Looked]


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """A change of inputs.

    `changes` per input the value to set, as its sensor shows it; empty where nothing that is
    allowed separates more than the present point does. `here` and `apart` are standard deviations
    per row of the measure, before and with it. `ramp` is how long the way there takes at
    least, `hold` how long to stay there, s. `costs` names inputs and modules that cost product.
    """

    changes: Mapping[str, float]
    here: tuple[float, ...]
    apart: tuple[float, ...]
    ramp: float = 0.0
    hold: float = 0.0
    costs: tuple[str, ...] = ()


def propose(allowed: Allowed, present: Mapping[str, float], measure: Measure) -> Proposal:
    """The best step from a point: inputs as their sensors show them."""
    base = measure([{}])
    here = tuple(float(v) for v in np.nan_to_num(base.apart[:, 0]))
    stay = Proposal(changes={}, here=here, apart=here)
    best = stay
    for _ in range(limits.MOST_INPUTS_OF_A_STEP):
        if _separated(best) == len(here):
            break
        points = list(_points(allowed, present, best.changes))
        further = [stay, *_judged(allowed, present, here, points, measure, base)] if points else []
        found = max(further, key=_worth, default=best)
        if _separated(found) == _separated(best):
            found = max(further, key=lambda p: sum(p.apart), default=best)
        if not _is_better(found, best):
            break
        best = found
    return best


def _points(
    allowed: Allowed, present: Mapping[str, float], before: Point
) -> Iterator[dict[str, float]]:
    """One more input is moved, to each of its levels."""
    for name, own in allowed.inputs.items():
        if name in before:
            continue
        least = limits.SMALLEST_CHANGE * (own.highest - own.lowest)
        for level in own.levels(limits.LEVELS_OF_A_STEP).tolist():
            if abs(level - present[name]) >= least:
                yield {**before, name: level}


def _judged(
    allowed: Allowed,
    present: Mapping[str, float],
    here: tuple[float, ...],
    points: Sequence[Point],
    measure: Measure,
    base: Looked,
) -> Iterator[Proposal]:
    looked = measure(points)
    for i, point in enumerate(points):
        apart = looked.apart[:, i]
        if np.isfinite(apart).any():
            ranges = {name: allowed.inputs[name] for name in point}
            moved = [
                module
                for module in sorted(allowed.costly)
                if _moves(looked.flows[module][i], base.flows[module][0])
            ]
            yield Proposal(
                changes=point,
                here=here,
                apart=tuple(float(v) for v in np.nan_to_num(apart)),
                ramp=max(abs(v - present[n]) / ranges[n].rate for n, v in point.items()),
                hold=max(own.hold for own in ranges.values()),
                costs=(*(n for n, own in ranges.items() if own.costs), *moved),
            )


def _moves(there: float, here: float) -> bool:
    """Does a flow change? One that is not known may."""
    return not abs(there - here) <= limits.SAME_FLOW * abs(here)


def _separated(proposal: Proposal) -> int:
    return sum(v >= limits.SEPARATED for v in proposal.apart)


def _worth(proposal: Proposal) -> tuple[int, int, float]:
    """Pairs that are told apart come first, then what it costs, then how far they are."""
    return _separated(proposal), -len(proposal.costs), sum(proposal.apart)


def _is_better(found: Proposal, best: Proposal) -> bool:
    """More pairs are told apart, or all of them together clearly farther."""
    more = sum(found.apart) >= sum(best.apart) + limits.CLEARLY_FARTHER
    return _separated(found) > _separated(best) or (more and _separated(found) == _separated(best))
