"""Slopes, visibility and thresholds (method.md, sections 1 and 2, claims 9, 13 and 18)."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from tests.method.readings import LIFTS, PUMPS, evaluate, noise_free, ruleset

STEP = 1e-6
LITRE_PER_HOUR, BAR = 1e-3 / 3600, 1e5


def slope(plant: str, observer: str, signal: str, values: dict[str, Array]) -> float:
    """Derivative in the plan: its scaled gradient with a unit uncertainty."""
    unit = {signal.replace(".", "_"): 1.0}
    found = evaluate(ruleset(plant), values, **unit)
    return float(found[f"s:{observer}:{signal}"][0])


@pytest.mark.parametrize("plant", PUMPS)
@pytest.mark.parametrize("fault", ["", "A.clogging"])
def test_slopes_are_finite_differences(plant: str, fault: str) -> None:
    """Claim 9: m_pump, m_pow, m_plant, m_resis and all others, healthy or not."""
    rules, values = ruleset(plant), noise_free(plant, fault, 0.3)
    signals = sorted({s for o in rules.observers for s in o.signals})
    shift = STEP * np.kron(np.eye(len(signals)), [1.0, -1.0])
    moved = {s: values[s] * (1 + shift[i]) for i, s in enumerate(signals)}
    ends, units = evaluate(rules, moved), {s.replace(".", "_"): 1.0 for s in signals}
    found = evaluate(rules, values, **units)
    for observer in rules.observers:
        for i, signal in enumerate(signals):
            up, down = ends[f"q:{observer.id}"][2 * i : 2 * i + 2]
            expected = (up - down) / (2 * STEP * values[signal][0])
            slopes = found.get(f"s:{observer.id}:{signal}", np.zeros(1))
            assert expected == pytest.approx(slopes[0], rel=1e-6, abs=1e-25)


def test_linearised_pump_observer() -> None:
    """Claim 9: c + m dp = Q_pump, with c of Eq. 10 and m of Eq. 9, to machine precision."""
    values = noise_free("abc", "A.clogging", 0.4)
    m = slope("abc", "A.pump", "A.dp", values)
    dp, n = float(values["A.dp"][0]), float(values["A.n"][0])
    C0, C1, C2 = 6 * LITRE_PER_HOUR, 0.010 * LITRE_PER_HOUR * 60, 2 * LITRE_PER_HOUR / BAR**2
    assert -2 * C2 * dp == pytest.approx(m, rel=1e-14)
    c = n * (10e-6 - C1) - C0 + C2 * dp**2
    observed = evaluate(ruleset("abc"), values)["q:A.pump"][0]
    assert observed == pytest.approx(c + m * dp, rel=1e-14)


@pytest.mark.parametrize("number", LIFTS)
def test_clogging_shows_for_every_static_head(number: str) -> None:
    """Claim 13: R_pump-plant/Q = 1 - sqrt(1 + y), whatever the pump and k0. method.md, 1.10: a
    degree of the whole pressure is y (1 - k0/dp_mod) of the healthy line."""
    y, static, rules = np.array([0.1, 0.2, 0.5]), LIFTS[number], ruleset("lines")
    for module in (kind + number for kind in "PDE"):
        values = noise_free("lines", f"{module}.clogging", y)
        found = evaluate(rules, values)
        flow = found[f"q:{module}.pump"]
        assert 1 - np.sqrt(1 + y) == pytest.approx(found[f"R:{module}.pump-plant"] / flow, abs=1e-6)
        if module[0] == "P":
            whole = (values[f"{module}.dp"] - values["M.dp"]) / BAR
            healthy = static + 5.2e-6 * (flow / LITRE_PER_HOUR) ** 2
            assert y * (1 - static / healthy) == pytest.approx(whole / healthy - 1, abs=1e-9)


BOUNDS = {
    "abc": {
        "A.pump-plant": 5, "A.power-plant": 35, "A.power-pump": 35,
        "C.pump-resis": 7, "C.power-resis": 49, "C.plant-resis": 4,
    },
    "large-centrifugal": {
        "A.pump-plant": 209, "A.power-plant": 193, "A.power-pump": 150,
        "C.pump-resis": 179, "C.power-resis": 174, "C.plant-resis": 40,
    },
}  # fmt: skip
"""dR of Table 1 alone, l/h (method.md, section 5). The second set is for 3.9 m3/h, ours is 3.76."""
TABLE_1 = {
    "A_n": 8 / 60, "B_n": 8 / 60, "A_dp": 1e3, "B_dp": 1e3, "A_P_el": 10.0, "B_P_el": 10.0,
    "C_dp": 200.0,
}  # fmt: skip


@pytest.mark.parametrize(("plant", "spread"), [("abc", 0.5), ("large-centrifugal", 9.0)])
def test_thresholds_of_table_1(plant: str, spread: float) -> None:
    """Sensor uncertainty of each residual, all shared sensors counted once."""
    found = evaluate(ruleset(plant), noise_free(plant), parameters=0.0, **TABLE_1)
    for residual, bound in BOUNDS[plant].items():
        bound_found = found[f"u:{residual}"][0] / LITRE_PER_HOUR
        assert bound == pytest.approx(bound_found, abs=spread), residual


def test_shared_sensors_are_not_independent() -> None:
    """method.md, 1.8: magnitudes of m_pump and m_plant add; by observer it would be 17 % less."""
    values = noise_free("large-centrifugal")
    only = {**dict.fromkeys(TABLE_1, 0.0), "A_dp": 1e3}
    found = evaluate(ruleset("large-centrifugal"), values, parameters=0.0, **only)
    pump, plant = (slope("large-centrifugal", f"A.{o}", "A.dp", values) for o in ("pump", "plant"))
    share = found["u:A.pump-plant"][0]
    assert (abs(pump) + abs(plant)) * 1e3 == pytest.approx(share, rel=1e-12)
    assert 0.83 == pytest.approx(np.hypot(pump, plant) * 1e3 / share, abs=0.01)


@pytest.mark.parametrize(
    ("plant", "modules", "printed"),
    [("feeds-1", 1, 0.067), ("abc", 2, 0.095), ("feeds-3", 3, 0.116), ("feeds-5", 5, 0.150)],
)
def test_detection_floor_grows_with_the_modules(plant: str, modules: int, printed: float) -> None:
    """Claim 18: the leakage at which power-resis leaves its Table 1 bound, about 0.067 sqrt(N)."""
    rules = ruleset(plant)
    reference = {s.id: np.array([s.reference]) for s in rules.signals}
    found = evaluate(rules, reference, parameters=0.0)
    floor = 2 * found["u:C.power-resis"][0] / found["q:A.power"][0]
    assert printed == pytest.approx(floor, abs=6e-4)
    assert 0.067 * np.sqrt(modules) == pytest.approx(floor, abs=6e-4)
