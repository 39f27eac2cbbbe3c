"""The plant warm (glycol, 0 to 60 degC) on readings worked out with CoolProp and `fluids`.

Nothing here is taken from the compiler or from kb/fluids: the parameters stand by hand.
"""

import math
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.recordings.recording import read_recording
from scipy.optimize import brentq

from tests.method.readings import PLANTS, ruleset
from tests.written import json_of, write_columns

SPEED = {"A": 900.0, "B": 700.0}
LENGTH, DIAMETER, ROUGHNESS = 10.0, 0.016, 1.5e-6
SAMPLES = 20


def glycol(letter: str, celsius: float) -> float:
    """Density (D, kg/m3) or viscosity (V, Pa s) of 30 % ethylene glycol."""
    coolprop = pytest.importorskip("CoolProp.CoolProp")  # slow to import
    return float(coolprop.PropsSI(letter, "T", celsius + 273.15, "P", 2e5, "INCOMP::MEG[0.30]"))


def pump(speed: float, dp: float, celsius: float) -> float:
    """Flow of a pump, l/h, at rpm and bar: slip by viscosity."""
    return 0.6 * speed - 6 - 0.01 * speed - 2 * dp**2 * 1e-3 / glycol("V", celsius)


def valve(flow: float, celsius: float) -> float:
    """Loss of a dosing line, bar, at l/h: by density."""
    return 0.05 + 5.2e-6 * flow**2 * glycol("D", celsius) / 998.2


def pipe(flow: float, celsius: float) -> float:
    """Loss of the common pipe, bar, at l/h: Darcy and Weisbach."""
    rho, mu = glycol("D", celsius), glycol("V", celsius)
    velocity = 4 * flow / 3.6e6 / (math.pi * DIAMETER**2)
    number = rho * velocity * DIAMETER / mu
    assert number < 2300 or number > 4006, "the transition has no law to compare with"
    friction = pytest.importorskip("fluids.friction")
    factor = friction.friction_factor(Re=number, eD=ROUGHNESS / DIAMETER, Method="Clamond")
    return float(factor * LENGTH / DIAMETER * rho * velocity**2 / 2 / 1e5)


def feed(speed: float, back: float, celsius: float, leakage: float) -> tuple[float, float]:
    """Pressure difference (bar) and flow into the line (l/h) of a module against a pressure."""

    def excess(dp: float) -> float:
        return dp - back - valve((1 - leakage) * pump(speed, dp, celsius), celsius)

    dp = brentq(excess, 0.0, 10.0)
    return dp, (1 - leakage) * pump(speed, dp, celsius)


def readings(celsius: float, leakage: float = 0.0, pace: float = 1.0) -> dict[str, float]:
    """Settled readings of the plant at a share of its speeds; module A may leak."""
    leak = {"A": leakage, "B": 0.0}
    speeds = {module: pace * n for module, n in SPEED.items()}

    def flow(back: float) -> float:
        return sum(feed(n, back, celsius, leak[m])[1] for m, n in speeds.items())

    back = brentq(lambda p: p - pipe(flow(p), celsius), 1e-3, 2.0)
    found = {"C.dp [bar]": back, "C.T [degC]": celsius}
    for module, n in speeds.items():
        dp, delivered = feed(n, back, celsius, leak[module])
        found |= {
            f"{module}.n [rpm]": n,
            f"{module}.dp [bar]": dp,
            f"{module}.P_el [W]": 25 + 0.095 * n + n * 10 * dp / 60 / 0.7 / 10,
            f"{module}.T [degC]": celsius,
            f"{module}.Q [l/h]": delivered,
        }
    return found


def recorded(folder: Path, points: list[dict[str, float]]) -> Path:
    """A recording that holds each point for a while."""
    held = {name: np.repeat([point[name] for point in points], SAMPLES) for name in points[0]}
    time = np.arange(len(points) * SAMPLES)
    return write_columns(folder / "recording.csv", {"time [s]": time, **held})


def diagnosed(folder: Path, points: list[dict[str, float]]) -> Diagnosis:
    rules = ruleset("warm")
    return diagnose(read_recording(recorded(folder, points), rules), rules)


def test_the_temperature_is_taken_into_account(tmp_path: Path) -> None:
    """The viscosity falls to a fifth between 0 and 60 degC, and no estimate disagrees; a leakage of
    0.2 in A is found at any temperature, with its degree."""
    found = diagnosed(tmp_path, [readings(c) for c in (0.0, 10.0, 20.0, 40.0, 60.0)])
    assert ([], []) == (list(found.findings), list(found.unknown))
    for celsius in (5.0, 55.0):
        found = diagnosed(tmp_path, [readings(celsius), readings(celsius, leakage=0.2)])
        assert ["A.leakage"] == [f.fault.id for f in found.findings]
        assert 0.2 == pytest.approx(found.findings[0].degree, abs=0.01)


def test_calibration_over_temperatures_finds_the_parameters(tmp_path: Path) -> None:
    """Slip at the reference viscosity, loss at the reference density, and no correction of
    Colebrook's law; the file is of the module type, whatever the fluid."""
    points = [readings(c, pace=p) for c in (20.0, 40.0, 60.0) for p in (0.8, 1.0, 1.2, 1.4)]
    recording, written = recorded(tmp_path, points), tmp_path / "found.yaml"
    modules = json_of("calibrate", PLANTS / "warm", recording, "-o", written)["modules"]
    assert "dosing-pcp-warm" == modules["A"]["type"]
    found = {n: p["value"] for m in "AC" for n, p in modules[m]["parameters"].items()}
    wanted = {"C2": 2.0, "k2": 5.2e-6, "c": 1.0}
    assert wanted == pytest.approx({n: found[n] for n in wanted}, rel=0.02)


def test_without_the_temperature_the_estimates_disagree(tmp_path: Path) -> None:
    """The same healthy readings at 60 degC, with thermometers that say 0: they are dead."""
    cold = {n: 0.0 if n.endswith("degC]") else v for n, v in readings(60.0).items()}
    found = diagnosed(tmp_path, [cold])
    assert {"F"} == {sensor.condition.status for sensor in found.sensors}
    assert all(sensor.id.endswith(".T.dead") for sensor in found.sensors)
    assert () == found.findings


def test_leaving_the_range_of_the_fluid_is_said(tmp_path: Path) -> None:
    """At 110 degC the closed forms of the glycol are not known to hold."""
    hot = {n: 110.0 if n == "A.T [degC]" else v for n, v in readings(20.0, leakage=0.3).items()}
    found = diagnosed(tmp_path, [hot])
    assert ["A.T is outside -10 to 95 degC"] == [
        u.text.split(" while ")[1].split(",")[0] for u in found.unknown
    ]
