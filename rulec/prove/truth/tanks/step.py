"""One integration step over a whole sample, for models that are simulated many times.

Source: Cash, Karp 1990, the pair of orders 5 and 4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

Rates = Callable[[float, Sequence[float]], list[float]]

NODES = (0.2, 0.3, 0.6, 1.0, 0.875)
STAGES = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (3 / 10, -9 / 10, 6 / 5),
    (-11 / 54, 5 / 2, -70 / 27, 35 / 27),
    (1631 / 55296, 175 / 512, 575 / 13824, 44275 / 110592, 253 / 4096),
)
FIFTH = (37 / 378, 0.0, 250 / 621, 125 / 594, 0.0, 512 / 1771)
FOURTH = (2825 / 27648, 0.0, 18575 / 48384, 13525 / 55296, 277 / 14336, 1 / 4)
OFF = tuple(a - b for a, b in zip(FIFTH, FOURTH, strict=True))

ACCEPTED = 1e-5
"""Largest estimated error of a step, cm; 5 microvolt of a usual sensor."""


def step(rates: Rates, state: Sequence[float], begin: float, end: float) -> list[float] | None:
    """Return the state at the end, or None if one step is not accurate enough."""
    width = end - begin
    slopes = [rates(begin, state)]
    for node, weights in zip(NODES, STAGES, strict=True):
        slopes.append(rates(begin + node * width, _moved(state, slopes, weights, width)))
    if max(map(abs, _moved([0.0] * len(state), slopes, OFF, width))) > ACCEPTED:
        return None
    return _moved(state, slopes, FIFTH, width)


def _moved(
    state: Sequence[float],
    slopes: Sequence[Sequence[float]],
    weights: Sequence[float],
    width: float,
) -> list[float]:
    """State plus weighted slopes."""
    result = list(state)
    for slope, weight in zip(slopes, weights, strict=True):
        if weight:
            by = weight * width
            result = [x + by * k for x, k in zip(result, slope, strict=True)]
    return result
