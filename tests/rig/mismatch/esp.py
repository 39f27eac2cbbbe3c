"""Pumps calibrated on water meet glycerin: head and power by viscosity, impeller by impeller.

Two of three series of equal temperature are shown to the tool; the third judges the repaired plant:
head and torque simulated from speed, flow and density.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.rig.esp import (
    FOLDER,
    IMPELLERS,
    Choice,
    Row,
    of_glycerin,
    of_pure_glycerin,
    write_points,
)
from tests.rig.mismatch.ask import Answer, adopt, simulate
from tests.rig.mismatch.case import Case, copy_plant
from tests.rig.mismatch.measure import numbers, rms

HEAD, TORQUE = "pump.dp [bar]", "pump.M [Nm]"
HELD_BACK = 3
SMALLEST = {"pump.Q [m3/h]": 2.0, HEAD: 0.3}
"""Below these the module type does not judge."""

BY_HAND = {
    "P37": "2.05; 1.18; 0.42, 0.30; 0.21, 0.22; 0.04 bar | 8.3; 4.5; 2.2, 1.8; 0.75, 0.60; 0.2",
    "P100": "1.60; 0.47; 0.35, 0.15; 0.12, 0.11; 0.05 bar | 12.7; 3.1; 3.9, 1.8; 0.94, 0.76; 0.4",
    "HC12500": "1.45; 0.58; 0.43, 0.12; 0.37, 0.11; 0.03 bar | 21.9; 6.5; 6.1, 3.0; 1.4, 1.3; 0.4",
}
"""Unseen series, head | torque (Nm): shipped; plain law refitted; one parameter (head less k*mu*Q,
power plus k*mu*n**2), alone and with the law refitted; two parameters (mu**s for mu; s 0.6 to 0.8
and 0.4 to 0.5), likewise; noise. With one liquid exp(-b*T) for mu**s does as well (b 0.05 and 0.03
per kelvin). Twice the same power with no viscosity in it (k*n**2) closes half: a rival to beat."""


def prepare(folder: Path, work: Path) -> list[Case]:
    """Per impeller: with viscosity; and one liquid, of which only the temperature is known."""
    cases = []
    for impeller in IMPELLERS:
        plant = copy_plant("esp-pump", work, f"{impeller.lower()}.yaml")
        for name, liquid, without in (
            ("with viscosity", of_glycerin, ()),
            ("one liquid, temperature only", of_pure_glycerin, ("pump.mu [mPas]",)),
        ):
            shown, unseen = (
                work / f"{impeller}-{name.split()[0]}-{part}.csv" for part in ("shown", "unseen")
            )
            write_points(folder / FOLDER, impeller, _and(liquid, False), shown, without)
            write_points(folder / FOLDER, impeller, _and(liquid, True), unseen, without)
            cases.append(Case(f"{impeller} {name}", plant, shown, unseen, BY_HAND[impeller]))
    return cases


def held_back(row: Row) -> bool:
    """Series (one temperature) that the tool does not see."""
    return int(row["replicate"]) % HELD_BACK == 0


def _and(liquid: Choice, unseen: bool) -> Choice:
    return lambda row: liquid(row) and held_back(row) == unseen


def errors(plant: Path, unseen: Path, target: Path) -> tuple[float, float]:
    """Root mean square error of simulated head (bar) and torque (Nm)."""
    simulate(plant, unseen, target)
    inside = np.all([numbers(unseen, t) >= least for t, least in SMALLEST.items()], axis=0)
    head, torque = (
        rms((numbers(target, title) - numbers(unseen, title))[inside]) for title in (HEAD, TORQUE)
    )
    return head, torque


def repair_lines(case: Case, answer: Answer, work: Path) -> list[str]:
    """Adopt, and compare head and torque on the unseen series."""
    before = errors(case.plant, case.unseen, work / "esp-shipped.csv")
    after = errors(adopt(answer), case.unseen, work / "esp-repaired.csv")
    return [
        f"{case.name}: head {before[0]:.3f} -> {after[0]:.3f} bar, "
        f"torque {before[1]:.2f} -> {after[1]:.2f} Nm"
    ]
