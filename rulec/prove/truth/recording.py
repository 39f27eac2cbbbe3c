"""The columns of a recording and of its truth; CSV."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path

from .units import Array


@dataclass(frozen=True)
class Recording:
    """Columns by header, in trade units; each ndarray, shape (n,).

    Attributes
    ----------
    readings : `time [s]` and `<instance>.<signal> [unit]`; NaN where a sensor is not fitted
    truth : `time [s]`, and what no sensor shows
    """

    readings: Mapping[str, Array]
    truth: Mapping[str, Array]


def write_csv(path: Path, columns: Mapping[str, Array], digits: int = 6) -> None:
    """Write columns with a fixed number of significant digits; NaN is an empty cell."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join("" if isnan(v) else f"{v:.{digits}g}" for v in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n", encoding="utf-8")
