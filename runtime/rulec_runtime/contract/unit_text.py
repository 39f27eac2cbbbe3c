"""Units as people type them."""

_TYPOGRAPHY = str.maketrans({"°": "deg", "²": "2", "³": "3", "·": "*", "⋅": "*", " ": None})


def plain_text(unit: str) -> str:
    """A unit as it is spelt in a table of units: ``m3/h`` for ``m³/h``, ``m**2`` for ``m^2``."""
    return unit.strip().translate(_TYPOGRAPHY).replace("^", "**")
