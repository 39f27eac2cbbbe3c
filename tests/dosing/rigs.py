"""Ready plants with the parameters of method.md, section 5."""

from collections.abc import Mapping

from rulec.prove.truth.settled.rig import Rig
from rulec.prove.truth.units import LITRE_PER_HOUR
from tests.dosing.plant import Plant

POWER_BY_SQUARE = 1.268e-6 / 0.15 / LITRE_PER_HOUR**2
"""Power of a centrifugal pump by the square of its flow, W/(m3/s)2, with all digits; module types
have four of them. Source: fit to TopS25slash10.mo (Modelica Buildings library), scaled to 15 %."""

WIDE = (15.0 / 25.0) ** 4
"""A DN25 mixer with the loss factor of a DN15 one. All five flows of the mixing rig through a DN15
mixer would lose 2 bar, more than the centrifugal pump can lift."""


def as_designed(rig: Rig) -> Plant:
    """Return a plant whose parameters are those of its data sheets."""
    values = {name: value for name, (value, _) in rig.numbers.items()}
    exact = {f"{m}.p2": POWER_BY_SQUARE for m, kind in rig.pumps.items() if kind == "centrifugal"}
    return Plant(rig, {**values, **exact})


def abc(pump_a: str = "cavity") -> Plant:
    """Return A and B, which feed mixer C."""
    pumps = {"A": pump_a, "B": "cavity"}
    return as_designed(Rig("abc", pumps, {"C": 1.0}, {"A": "C", "B": "C", "C": None}))


_CAVITIES = dict.fromkeys("ABC", "cavity")
_SERIES = {"A": "M1", "B": "M1", "C": "M2", "M1": "M2", "M2": None}

RIGS: Mapping[str, Plant] = {
    "abc": abc(),
    "abc-centrifugal": abc("centrifugal"),
    "abc-membrane": abc("membrane"),
    # The paper's rig
    "mixing-rig": as_designed(
        Rig(
            "mixing-rig",
            {**_CAVITIES, "D": "membrane", "E": "centrifugal"},
            {"M1": 1.0, "M2": WIDE},
            {**_SERIES, "C": "M1", "D": "M2", "E": "M2"},
        )
    ),
    "series": as_designed(Rig("series", _CAVITIES, {"M1": 1.0, "M2": 1.0}, _SERIES)),
    "three": as_designed(
        Rig("three", _CAVITIES, {"M": 1.0}, {**dict.fromkeys("ABC", "M"), "M": None})
    ),
}
