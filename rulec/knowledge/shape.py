"""Prior knowledge of an unknown parameter."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rulec.language.units import Unit

USUAL_HINT = "add 'usual: {median: ..., factor: 3, source: ...}', or 'change: 0.05' for a share"
"""Remedy for a missing usual size."""


@dataclass(frozen=True)
class Usual:
    """The usual size of an amplitude: its distance from the null, SI.

    If `of_place`, `size` is instead the share by which the place usually changes. `factor` is the
    geometric standard deviation.
    """

    size: float
    factor: float
    of_place: bool


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Prior knowledge of an unknown parameter; numbers in SI.

    At `null` the plain law holds, whatever the other parameters; None for a parameter that only
    shapes the term (a threshold, an exponent). `starts` are values to try, `quantiles` quantiles of
    the readings of `driver` to try. A `fixed` parameter is not unknown, but a typical reading of
    `driver`; if it is `neutral`, the plain law holds at that reading, whatever the other
    parameters. `usual` is the usual size of a parameter with a null.
    """

    name: str
    title: str
    null: float | None = None
    lowest: float = -math.inf
    highest: float = math.inf
    starts: tuple[float, ...] = ()
    quantiles: tuple[float, ...] = ()
    driver: str | None = None
    fixed: bool = False
    neutral: bool = False
    usual: Usual | None = None


def usual_of(part: Mapping[str, Any], unit: Unit | None = None) -> Usual | None:
    """The usual size that a parameter or a degree states; shares of a place have no unit."""
    stated = part.get("usual")
    if stated is None:
        return None
    if "change" in stated:
        return Usual(float(stated["change"]), float(stated["factor"]), of_place=True)
    # A size is a difference from the null, so the offset of a unit does not apply.
    factor = 1.0 if unit is None else unit.factor
    return Usual(abs(stated["median"]) * factor, float(stated["factor"]), of_place=False)
