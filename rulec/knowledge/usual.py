"""How large an effect or a fault usually is, as its file says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rulec.knowledge.shape import Usual
from rulec.language.units import Unit

USUAL_HINT = "add 'usual: {median: ..., factor: 3, source: ...}', or 'change: 0.05' for a share"
"""How to say how large something usually is."""


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
