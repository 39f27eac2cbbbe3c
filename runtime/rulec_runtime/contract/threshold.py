"""When a residual counts as moved: the only place that decides this."""

from typing import TypeVar

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array

Size = TypeVar("Size", float, Array)


def threshold_of(u: Size) -> Size:
    """Threshold of a residual with standard uncertainty `u`, or of several; in the unit of `u`.

    A degree with standard uncertainty `u` is detectable from there on.

    >>> threshold_of(0.5)
    1.5
    """
    return limits.THRESHOLD * u


def sign_of(value: float, u: float) -> str:
    """Sign of a residual with standard uncertainty `u`: `+`, `-`, or `0` within its threshold.

    >>> sign_of(-2.0, 0.5), sign_of(1.5, 0.5)
    ('-', '0')
    """
    if abs(value) <= threshold_of(u):
        return "0"
    return "+" if value > 0 else "-"
