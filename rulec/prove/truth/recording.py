"""The file of a recording."""

from collections.abc import Mapping
from math import isnan
from pathlib import Path

from .units import Array


def write_csv(path: Path, columns: Mapping[str, Array], digits: int = 6) -> None:
    """Write columns with a fixed number of significant digits; NaN is an empty cell."""
    rows = zip(*(values.tolist() for values in columns.values()), strict=True)
    lines = [",".join("" if isnan(v) else f"{v:.{digits}g}" for v in row) for row in rows]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n", encoding="utf-8")
