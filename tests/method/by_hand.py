"""The rules of method.md, section 3, for the plant abc, written out by hand in trade units.

l/h, bar, W, rpm. Two dosing modules A and B, a mixer C; independent of the compiler.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

K0, K2, MIXER_K2 = 0.05, 5.2e-6, 3.5e-7


@dataclass(frozen=True)
class Dosing:
    """Observers and slopes of a dosing module at its readings."""

    dp: Array
    power_reading: Array
    loss: Array
    pump: Array
    power: Array
    plant: Array
    m_pump: Array
    m_pow: Array
    m_plant: Array

    @property
    def whole(self) -> Array:
        """Pressure difference of the line, static part included: what Eq. 16 relates to."""
        return self.loss + K0

    @property
    def m_eff(self) -> Array:
        """Pump and line in series, seen from the mixer."""
        return self.m_pump * self.m_plant / (self.m_plant - self.m_pump)


def pump_law(kind: str, n: Array, dp: Array) -> tuple[Array, Array, Array, Array]:
    """Flow, its slope by pressure, power, its slope by pressure."""
    if kind == "pcp":
        return (
            0.6 * n - 6 - 0.01 * n - 2 * dp**2, -4 * dp,
            25 + 0.095 * n + n * dp / 42, n / 42,
        )  # fmt: skip
    if kind == "membrane":
        return (
            3 * n - 2 - 0.02 * n - 6 * dp, np.full_like(dp, -6.0),
            20 + 0.25 * n + n * dp * 5 / 39, n * 5 / 39,
        )  # fmt: skip
    ratio, h1, h2 = n / 2650, 1.713e-5 / 0.15, 6.84e-9 / 0.15**2
    p0, p1, p2 = 188.3 * 0.15, 0.03228, 1.268e-6 / 0.15
    flow = ratio * (-h1 + np.sqrt(h1**2 + 4 * h2 * (1.111 - dp / ratio**2))) / (2 * h2)
    slope = -1 / (ratio * h1 + 2 * h2 * flow)
    power = ratio**3 * p0 + ratio**2 * p1 * flow - ratio * p2 * flow**2
    return flow, slope, power, (ratio**2 * p1 - 2 * ratio * p2 * flow) * slope


def pump_pressure(kind: str, n: Array, flow: Array) -> Array:
    """The pressure at which a pump gives a flow; NaN where none does."""
    if kind == "pcp":
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sqrt((0.59 * n - 6 - flow) / 2))
    if kind == "membrane":
        return (2.98 * n - 2 - flow) / 6
    ratio = n / 2650
    return ratio**2 * 1.111 - ratio * 1.713e-5 / 0.15 * flow - 6.84e-9 / 0.15**2 * flow**2


def dosing(kind: str, n: Array, dp: Array, power_reading: Array, mixer: Array) -> Dosing:
    """Observers of one module."""
    flow, slope, power, power_slope = pump_law(kind, n, dp)
    by_power = flow * power_reading / power
    loss = dp - mixer - K0
    plant = np.sqrt(loss / K2)
    return Dosing(
        dp, power_reading, loss, flow, by_power, plant,
        slope, by_power * (slope / flow - power_slope / power), 1 / (2 * K2 * plant),
    )  # fmt: skip


def observe(
    kinds: Mapping[str, str], values: Mapping[str, Array]
) -> tuple[dict[str, Dosing], Array]:
    """Both modules, and the mixer's flow, from SI readings."""
    bar, rpm = 1e5, 1 / 60
    mixer = values["C.dp"] / bar
    modules = {
        name: dosing(
            kind,
            values[f"{name}.n"] / rpm,
            values[f"{name}.dp"] / bar,
            values[f"{name}.P_el"],
            mixer,
        )
        for name, kind in kinds.items()
    }
    return modules, np.sqrt(mixer / MIXER_K2)


def residuals(kinds: Mapping[str, str], values: Mapping[str, Array]) -> dict[str, Array]:
    """All nine residuals, l/h."""
    modules, resis = observe(kinds, values)
    result: dict[str, Array] = {}
    for name, m in modules.items():
        result |= {
            f"{name}.pump-plant": m.pump - m.plant,
            f"{name}.power-plant": m.power - m.plant,
            f"{name}.power-pump": m.power - m.pump,
        }
    for kind in ("pump", "power", "plant"):
        result[f"C.{kind}-resis"] = sum(getattr(m, kind) for m in modules.values()) - resis
    return result


def rules(kinds: Mapping[str, str], values: Mapping[str, Array], paper: bool) -> dict[str, Array]:
    """Degree of every cell, `fault:residual`; `paper` takes Eq. 16 for clogging and widening.

    Eq. 16 is printed with the whole pressure difference of the line, the others with its friction.
    """
    modules, resis = observe(kinds, values)
    R = residuals(kinds, values)
    found: dict[str, Array] = {}
    for name, m in modules.items():
        found |= _leakage(name, m, R)
        loss = m.whole if paper else m.loss
        found |= _two_ways(f"{name}.clogging", f"{name}.widening", loss, _line(name, m, paper), R)
        found |= _two_ways(f"{name}.dp.high", f"{name}.dp.low", m.dp, _pump_pressure(name, m), R)
        slopes = dict.fromkeys(
            (f"{name}.power-plant", f"{name}.power-pump", "C.power-resis"),
            m.power / m.power_reading,
        )
        high, low = f"{name}.P_el.high", f"{name}.P_el.low"
        found |= _two_ways(high, low, m.power_reading, slopes, R)
    pressure = values["C.dp"] / 1e5
    own = _mixer(modules, resis, paper)
    found |= _two_ways("C.clogging", "C.widening", pressure, own, R)
    found |= _two_ways("C.dp.high", "C.dp.low", pressure, _mixer_pressure(modules, resis), R)
    return found


def _two_ways(
    up: str, down: str, g: Array, slopes: Mapping[str, Array], R: Mapping[str, Array]
) -> dict[str, Array]:
    """x(+) = R/(mu g - R) and x(-) = -R/(mu g - R)."""
    result: dict[str, Array] = {}
    for residual, mu in slopes.items():
        x = R[residual] / (mu * g - R[residual])
        result |= {f"{up}:{residual}": x, f"{down}:{residual}": -x}
    return result


def _leakage(name: str, m: Dosing, R: Mapping[str, Array]) -> dict[str, Array]:
    flows = {
        f"{name}.pump-plant": m.pump, f"{name}.power-plant": m.power,
        "C.pump-resis": m.pump, "C.power-resis": m.power,
    }  # fmt: skip
    return {f"{name}.leakage:{r}": R[r] / flow for r, flow in flows.items()}


def _line(name: str, m: Dosing, paper: bool) -> dict[str, Array]:
    reaction = m.m_pump if paper else 0.0
    return {
        f"{name}.pump-plant": reaction - m.m_plant,
        f"{name}.power-plant": reaction - m.m_plant,
        "C.plant-resis": m.m_plant - reaction,
    }


def _pump_pressure(name: str, m: Dosing) -> dict[str, Array]:
    return {
        f"{name}.pump-plant": m.m_pump - m.m_plant,
        f"{name}.power-plant": m.m_pow - m.m_plant,
        f"{name}.power-pump": m.m_pow - m.m_pump,
        "C.pump-resis": m.m_pump,
        "C.power-resis": m.m_pow,
        "C.plant-resis": m.m_plant,
    }


def _mixer(modules: Mapping[str, Dosing], resis: Array, paper: bool) -> dict[str, Array]:
    slope = -1 / (2 * MIXER_K2 * resis)
    if paper:
        slope = slope + sum(m.m_eff for m in modules.values())
    return {f"C.{kind}-resis": slope for kind in ("pump", "power", "plant")}


def _mixer_pressure(modules: Mapping[str, Dosing], resis: Array) -> dict[str, Array]:
    own = -1 / (2 * MIXER_K2 * resis)
    slopes = {"C.pump-resis": own, "C.power-resis": own}
    slopes["C.plant-resis"] = own - sum(m.m_plant for m in modules.values())
    for name, m in modules.items():
        slopes |= {f"{name}.pump-plant": m.m_plant, f"{name}.power-plant": m.m_plant}
    return slopes


def exact(kinds: Mapping[str, str], values: Mapping[str, Array]) -> dict[str, Array]:
    """Degrees without linearisation: what is measured over what the other observers ask for."""
    modules, resis = observe(kinds, values)
    pressure, found = values["C.dp"] / 1e5, {}

    def put(up: str, down: str, residual: str, ratio: Array) -> None:
        found[f"{up}:{residual}"], found[f"{down}:{residual}"] = ratio - 1, 1 - ratio

    for name, m in modules.items():
        rest = resis - sum(o.plant for other, o in modules.items() if other != name)
        clogging, high = (
            (f"{name}.clogging", f"{name}.widening"),
            (f"{name}.dp.high", f"{name}.dp.low"),
        )
        put(*clogging, f"{name}.pump-plant", m.loss / (K2 * m.pump**2))
        put(*clogging, f"{name}.power-plant", m.loss / (K2 * m.power**2))
        put(*clogging, "C.plant-resis", m.loss / (K2 * rest**2))
        put(*high, "C.plant-resis", m.dp / (K0 + pressure + K2 * rest**2))
        net = resis - sum(o.pump for other, o in modules.items() if other != name)
        should = pump_pressure(kinds[name], values[f"{name}.n"] * 60, net)
        put(*high, "C.pump-resis", m.dp / should)
        draw = (f"{name}.P_el.high", f"{name}.P_el.low")
        others = resis - sum(o.power for other, o in modules.items() if other != name)
        put(*draw, f"{name}.power-plant", m.power / m.plant)
        put(*draw, f"{name}.power-pump", m.power / m.pump)
        put(*draw, "C.power-resis", m.power / others)
    for kind in ("pump", "power"):
        flow = sum(getattr(m, kind) for m in modules.values())
        put("C.clogging", "C.widening", f"C.{kind}-resis", pressure / (MIXER_K2 * flow**2))
        put("C.dp.high", "C.dp.low", f"C.{kind}-resis", pressure / (MIXER_K2 * flow**2))
    flow = sum(m.plant for m in modules.values())
    put("C.clogging", "C.widening", "C.plant-resis", pressure / (MIXER_K2 * flow**2))
    return found
