"""How numbers, sums and sentences are written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping


def rounded(value: float, digits: int) -> float:
    """Round to significant digits, fewer than a solver's, so that files agree on every machine."""
    return float(f"{value:.{digits}g}")


def signed_sum(terms: Iterable[tuple[float, str]]) -> str:
    """A signed sum of (sign, name) as text; ``0`` if it has no terms.

    >>> signed_sum([(1, "A"), (-1, "B")])
    'A - B'
    """
    text = " ".join(f"{'+' if sign > 0 else '-'} {name}" for sign, name in terms)
    return text.removeprefix("+ ") or "0"


def filled(text: str, slots: Mapping[str, str]) -> str:
    """A sentence with slots such as ``{module}`` filled; unknown slots stay."""
    for slot, value in slots.items():
        text = text.replace(f"{{{slot}}}", value)
    return text
