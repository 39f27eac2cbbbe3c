"""How the degree of a fault is written: as a share, or as a size in the unit of the reading."""

from rulec_runtime.contract.ruleset import FaultSpec

LARGE = 10.0
"""Above this a share is written as ``>10``: it has nothing left to be compared with."""


def degree_in_words(fault: FaultSpec, value: float) -> str:
    """For a sentence: ``20 %``, or ``2 K``."""
    return f"{_three(value)} {fault.unit}" if fault.unit else f"{_three(100 * value)} %"


def _three(value: float) -> str:
    """Three significant digits, never as a power of ten.

    >>> _three(12.345), _three(1786.0), _three(2.0)
    ('12.3', '1790', '2')
    """
    return f"{float(f'{value:.3g}'):.15g}"


def degree_in_figures(fault: FaultSpec, low: float, high: float | None = None) -> str:
    """For a table: ``0.200``, or ``1.98-2.02 K``."""
    ends = [low] if high is None else [low, high]
    if fault.unit:
        return f"{'-'.join(map(_three, ends))} {fault.unit}"
    return "-".join(f"{end:.3f}" for end in ends)


def smallest_degree(fault: FaultSpec, value: float) -> str:
    """For a cell of the matrix: ``0.12``, ``>10``, or ``0.43 K``.

    A degree beyond the range of the fault is written as ``>0.9``: nothing it can do shows there.
    """
    unit = f" {fault.unit}" if fault.unit else ""
    most = fault.highest if unit else min(fault.highest, LARGE)
    return f"{value:.2g}{unit}" if value <= most else f">{most:.3g}{unit}"
