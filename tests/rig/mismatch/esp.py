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
    "P37": "2.05 | 1.18 | 0.42 | 0.21 | 0.19 bar; 8.3 | 4.5 | 2.2 | 0.9 Nm; noise 0.04 bar, 0.2 Nm",
    "P100": "1.60 | 0.47 | 0.35 | 0.11 | 0.10 bar; 12.7 | 3.1 | 3.9 | 1.7 Nm; noise 0.05, 0.4",
    "HC12500": "1.45 | 0.58 | 0.43 | 0.38 | 0.26 bar; 21.9 | 6.5 | 6.1 | 2.9 Nm; noise 0.03, 0.4",
}
"""Unseen series. Head: shipped | plain law refitted | loss k*mu*Q | loss k*rho*n*Q*Re^-m | head and
flow scaled by Re. Torque: shipped | refitted | friction k*mu*n | k*rho*n^2*Re^-m, m about 0.45."""


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
