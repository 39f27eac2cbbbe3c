"""Ready plants with the parameters of method.md, section 5."""

from collections.abc import Callable, Mapping

from .plant import DosingModule, Line, Mixer, Plant
from .pumps import centrifugal, membrane, progressive_cavity
from .units import BAR, LITRE_PER_HOUR, RPM

DOSING_LINE = Line(static=0.05 * BAR, quadratic=5.2e-6 * BAR / LITRE_PER_HOUR**2)
MIXER = Mixer(quadratic=3.5e-7 * BAR / LITRE_PER_HOUR**2)  # DN15
# DN25 with the same loss factor: (15/25)^4 of the loss. All five flows of the mixing rig through
# a DN15 mixer would lose 2 bar, more than the centrifugal pump can lift.
WIDE_MIXER = Mixer(quadratic=MIXER.quadratic * (15.0 / 25.0) ** 4)


MODULES = {
    "pcp": DosingModule(progressive_cavity(), DOSING_LINE, 900.0 * RPM, 400.0 * RPM, 1300.0 * RPM),
    # The gear ratio is assumed: with +-8 rpm at the stroke counter, the speed is known to 7 %.
    "membrane": DosingModule(
        membrane(), DOSING_LINE, 120.0 * RPM, 60.0 * RPM, 160.0 * RPM, gear_ratio=10.0
    ),
    # The speeds are close together because the head falls with their square; it needs strong
    # throttling because its curve is flat.
    "centrifugal": DosingModule(
        centrifugal(), DOSING_LINE, 2650.0 * RPM, 2000.0 * RPM, 3000.0 * RPM, (0.0, 2.0, 10.0)
    ),
}
"""Dosing modules by pump type."""


def abc(pump_a: str = "pcp") -> Plant:
    """Return A and B, which feed mixer C."""
    modules = {"A": MODULES[pump_a], "B": MODULES["pcp"]}
    return Plant(modules, {"C": MIXER}, {"A": "C", "B": "C", "C": None})


def three() -> Plant:
    """Return A, B and C, which feed one mixer M."""
    modules = dict.fromkeys("ABC", MODULES["pcp"])
    return Plant(modules, {"M": MIXER}, {"A": "M", "B": "M", "C": "M", "M": None})


def series() -> Plant:
    """Return A and B, which feed M1; M1 and C feed M2."""
    downstream = {"A": "M1", "B": "M1", "C": "M2", "M1": "M2", "M2": None}
    return Plant(dict.fromkeys("ABC", MODULES["pcp"]), {"M1": MIXER, "M2": MIXER}, downstream)


def mixing_rig() -> Plant:
    """Return the paper's rig: A, B, C feed M1; M1, D (membrane), E (centrifugal) feed M2."""
    modules = dict.fromkeys("ABC", MODULES["pcp"])
    modules |= {"D": MODULES["membrane"], "E": MODULES["centrifugal"]}
    downstream = {"A": "M1", "B": "M1", "C": "M1", "D": "M2", "E": "M2", "M1": "M2", "M2": None}
    return Plant(modules, {"M1": MIXER, "M2": WIDE_MIXER}, downstream)


RIGS: Mapping[str, Callable[[], Plant]] = {
    "abc": abc,
    "abc-centrifugal": lambda: abc(pump_a="centrifugal"),
    "abc-membrane": lambda: abc(pump_a="membrane"),
    "mixing-rig": mixing_rig,
    "series": series,
    "three": three,
}
