"""A curve with its band in rows of characters."""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.report.text import number

CURVE, BAND = "•", "░"

ACROSS, DOWN = 44, 7
"""Characters of a plot."""


def text_plot(at: Array, value: Array, u: Array, units: tuple[str, str]) -> list[str]:
    """A curve over a driver with two standard uncertainties on either side; all of shape (n,).

    `units` are those of the driver and of the value.

    >>> z = np.linspace(0.0, 1.0, 5)
    >>> for row in text_plot(z, z, 0.0 * z, ("degC", "bar"))[::3]: print(row)
    1 bar ┤                                        ••••
          │                  ••••••••
        0 ┤••••
    """
    z = np.linspace(float(at[0]), float(at[-1]), ACROSS)
    middle, spread = np.interp(z, at, value), 2.0 * np.interp(z, at, u)
    low, high = float(np.min(middle - spread)), float(np.max(middle + spread))
    if not np.isfinite([low, high]).all() or high <= low:
        return []

    def row(values: Array) -> Array:
        return np.rint((high - values) / (high - low) * (DOWN - 1)).astype(int)

    cells = np.full((DOWN, ACROSS), " ")
    for i, (top, foot) in enumerate(zip(row(middle + spread), row(middle - spread), strict=True)):
        cells[top : foot + 1, i] = BAND
    cells[row(middle), np.arange(ACROSS)] = CURVE
    labels = [""] * DOWN
    labels[-1] = number(low)
    if low < 0.0 < high:
        labels[int(row(np.zeros(1))[0])] = "0"
    labels[0] = f"{number(high)} {units[1]}" if units[1] != "1" else number(high)
    width = max(map(len, labels))
    rows = [
        f"{label:>{width}} {'┤' if label else '│'}{''.join(line).rstrip()}"
        for label, line in zip(labels, cells, strict=True)
    ]
    first, last = number(float(at[0])), number(float(at[-1]))
    last += f" {units[0]}" if units[0] != "1" else ""
    rows.append(f"{'':>{width}}  {first}{last:>{ACROSS - len(first)}}")
    return rows
