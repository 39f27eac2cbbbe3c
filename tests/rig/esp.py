"""Multistage centrifugal pumps on a test loop: operating points as a recording.

Every row of the source is a steady operating point of its own, without a time; the recording gets
one row a minute, in the order of the source. Water rows have neither density nor viscosity: both
follow from the inlet temperature. The pump's plain law is calibrated on water.
"""

import csv
import gzip
from collections.abc import Callable, Mapping
from math import exp
from pathlib import Path

FOLDER = "esp-viscous-pump-curves"
IMPELLERS = ("P37", "P100", "HC12500")
SPACING = 60.0
"""Seconds between two rows; they stand for no real time."""

HEADER = (
    "time [s]",
    "pump.n [rpm]",
    "pump.Q [m3/h]",
    "pump.dp [bar]",
    "pump.M [Nm]",
    "pump.rho [kg/m3]",
    "pump.T [degC]",
    "pump.mu [mPas]",
)

Row = Mapping[str, str]
Choice = Callable[[Row], bool]


def of_water(row: Row) -> bool:
    """Points with water, on which the plain law is calibrated."""
    return row["kind"] == "water"


def of_glycerin(row: Row) -> bool:
    """Points with glycerin, pure or diluted."""
    return row["kind"] == "viscous"


def write_points(folder: Path, impeller: str, chosen: Choice, target: Path) -> int:
    """Write some points of an impeller as a recording; returns how many."""
    with gzip.open(folder / "points.csv.gz", "rt", encoding="utf-8") as source:
        rows = [r for r in csv.DictReader(source) if r["model"] == impeller and chosen(r)]
    with target.open("w", newline="", encoding="utf-8") as out:
        writer = csv.writer(out)
        writer.writerow(HEADER)
        for number, row in enumerate(rows):
            writer.writerow([f"{x:.7g}" for x in (number * SPACING, *_readings(row))])
    return len(rows)


def _readings(row: Row) -> tuple[float, ...]:
    """Readings of one point in the order of `HEADER`, time left out."""
    temperature = float(row["T1_C"])
    water = of_water(row)
    density = _water_density(temperature) if water else float(row["rho_in_kgpm3"])
    viscosity = _water_viscosity(temperature) if water else float(row["mu_in_cP"])
    return (
        float(row["rpm"]),
        float(row["mass_flow_kgph"]) / density,
        float(row["p_out_bar"]) - float(row["p_in_bar"]),
        float(row["torque_Nm"]),
        density,
        temperature,
        viscosity,
    )


def _water_density(t: float) -> float:
    """Density of water at t degC, kg/m3. Source: Kell 1975, J. Chem. Eng. Data 20, Eq. 16."""
    terms = (999.83952, 16.945176, -7.9870401e-3, -46.170461e-6, 105.56302e-9, -280.54253e-12)
    return sum(c * t**i for i, c in enumerate(terms)) / (1 + 16.879850e-3 * t)


def _water_viscosity(t: float) -> float:
    """Viscosity of water at t degC, mPas. Source: Vogel 1921, constants as in kb/fluids."""
    return 0.02956263 * exp(503.2785 / (t + 273.15 - 150.4109))
