"""What is known of an unknown parameter before any reading."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rulec.language.units import Unit

USUAL_HINT = "add 'usual: {median: ..., factor: 3, source: ...}', or 'change: 0.05' for a share"
"""How to say how large something usually is."""


@dataclass(frozen=True)
class Usual:
    """How large an amplitude usually is: `size` away from its null, SI, known to a `factor`.

    Where it is `of_place`, `size` is the share by which the place is usually changed instead.
    `factor` is the geometric standard deviation.
    """

    size: float
    factor: float
    of_place: bool


@dataclass(frozen=True, kw_only=True)
class Shape:
    """What is known of an unknown parameter before any reading; numbers in SI.

    At `null` the plain relation comes back, whatever the other parameters are; None where the
    parameter only shapes the term (a threshold, an exponent). `starts` are values to try,
    `quantiles` quantiles of the readings of `driver` to try. A parameter that is `fixed` is no
    unknown, but a typical reading of `driver`; where it is `neutral`, the plain law holds at that
    reading, whatever the other parameters are. `usual` is how large one that has a null usually is.
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
    """The usual size that a parameter or a degree states; shares of the place have no unit."""
    stated = part.get("usual")
    if stated is None:
        return None
    if "change" in stated:
        return Usual(float(stated["change"]), float(stated["factor"]), of_place=True)
    # A size is a difference from the null: no zero of a unit belongs to it.
    factor = 1.0 if unit is None else unit.factor
    return Usual(abs(stated["median"]) * factor, float(stated["factor"]), of_place=False)
