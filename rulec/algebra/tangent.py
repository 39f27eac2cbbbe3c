"""Exact derivatives of a plan: values and tangents, propagated operation by operation.

Source: forward-mode differentiation (Wengert 1964). At corners the compiler's conventions hold:
abs has slope 0, min and max half the slope of each side, sign has slope 0 everywhere.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from rulec_runtime.contract.plan import ABSENT, OPERATIONS, UNARY, Array, Plan

Slopes = dict[int, Array]
"""Derivatives of a value, by the numbers of the seeds on which it depends."""


def run_with_slopes(
    plan: Plan, values: Mapping[str, Array | float], seeds: Sequence[str]
) -> tuple[dict[str, Array], dict[str, dict[str, Array]]]:
    """Evaluate a plan and the derivatives of all outputs with respect to some inputs.

    Parameters
    ----------
    values : per input an array, shape (n,), or a number; absent ones count as NaN.
    seeds : inputs to differentiate by; names that are no inputs of the plan are ignored.

    Returns
    -------
    Per output its value, shape (n,) or a number; per output and seed the derivative, likewise.
    Seeds that an output does not depend on are absent.
    """
    numbers = [np.asarray(values.get(name, ABSENT), dtype=float) for name in plan.inputs]
    numbers += [np.asarray(c) for c in plan.constants]
    slopes: list[Slopes] = [{} for _ in numbers]
    index = {name: i for i, name in enumerate(plan.inputs)}
    for j, seed in enumerate(seeds):
        if seed in index:
            slopes[index[seed]] = {j: np.asarray(1.0)}
    with np.errstate(all="ignore"):
        for name, a, b in plan.operations:
            if name in UNARY:
                x, value = numbers[a], OPERATIONS[name](numbers[a])
                own = _times(_UNARY[name](x, value), slopes[a]) if slopes[a] else {}
            else:
                x, y = numbers[a], numbers[b]
                value = OPERATIONS[name](x, y)
                left, right = slopes[a], slopes[b]
                own = _binary(name, x, y, value, left, right) if left or right else {}
            numbers.append(value)
            slopes.append(own)
    return (
        {name: np.asarray(numbers[i]) for name, i in plan.outputs.items()},
        {
            name: {seeds[j]: np.asarray(slope) for j, slope in slopes[i].items()}
            for name, i in plan.outputs.items()
        },
    )


MINUS_ONE = np.asarray(-1.0)

_UNARY: Mapping[str, Callable[[Array, Array], Array]] = {
    "neg": lambda x, v: MINUS_ONE,
    "sqrt": lambda x, v: 0.5 / v,
    "abs": lambda x, v: np.sign(x),
    "sign": lambda x, v: np.asarray(0.0),
    "exp": lambda x, v: v,
    "log": lambda x, v: 1.0 / x,
    "tanh": lambda x, v: 1.0 - v * v,
}


def _binary(name: str, x: Array, y: Array, value: Array, left: Slopes, right: Slopes) -> Slopes:
    if name == "add":
        return _sum(left, right)
    if name == "sub":
        return _sum(left, _times(MINUS_ONE, right))
    if name == "mul":
        return _sum(_times(y, left), _times(x, right))
    if name == "div":
        by = 1.0 / y
        return _sum(_times(by, left), _times(-value * by, right) if right else right)
    if name == "pow":
        # The base of an unknown exponent is positive; the log of any other base is not used.
        by_base = _times(y * np.power(x, y - 1.0), left) if left else left
        return _sum(by_base, _times(value * np.log(x), right) if right else right)
    lower = (1.0 + np.sign(y - x)) / 2.0
    if name == "max":
        lower = 1.0 - lower
    return _sum(_times(lower, left), _times(1.0 - lower, right))


def _times(factor: Array, slopes: Slopes) -> Slopes:
    return {j: factor * s for j, s in slopes.items()}


def _sum(left: Slopes, right: Slopes) -> Slopes:
    """Slopes of a sum. Slopes are never changed in place, so one side alone can be returned."""
    if not right:
        return left
    if not left:
        return right
    result = left.copy()
    for j, s in right.items():
        result[j] = result[j] + s if j in result else s
    return result
