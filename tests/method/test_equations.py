"""Equations 8 to 10, 12 and 16 of the seed paper come out of the derivation, symbolically."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import sympy

from rulec.passes.differentiate import FLOW, GATHERED, TypeModel
from tests.method.readings import model

Law = Callable[[TypeModel], sympy.Expr]


def _pcp_flow(m: TypeModel) -> sympy.Expr:
    n, dp, V, C0, C1, C2 = (m.symbols[s] for s in ("n", "dp", "V", "C0", "C1", "C2"))
    return n * V - (C0 + C1 * n + C2 * dp**2)


def _pcp_slope(m: TypeModel) -> sympy.Expr:
    """Eq. 9."""
    return -2 * m.symbols["C2"] * m.symbols["dp"]


def _pcp_offset(m: TypeModel) -> sympy.Expr:
    """Eq. 10."""
    n, dp, V, C0, C1, C2 = (m.symbols[s] for s in ("n", "dp", "V", "C0", "C1", "C2"))
    return n * (V - C1) - C0 + C2 * dp**2


def _displacement_power(m: TypeModel) -> sympy.Expr:
    n, dp, V, P0, P1, eta = (m.symbols[s] for s in ("n", "dp", "V", "P0", "P1", "eta"))
    return P0 + P1 * n + n * V * dp / eta


def _membrane_flow(m: TypeModel) -> sympy.Expr:
    n, dp, V, C0, C1, C2 = (m.symbols[s] for s in ("n", "dp", "V", "C0", "C1", "C2"))
    return n * V - (C0 + C1 * n + C2 * dp)


def _membrane_slope(m: TypeModel) -> sympy.Expr:
    return -m.symbols["C2"]


def _membrane_offset(m: TypeModel) -> sympy.Expr:
    n, V, C0, C1 = (m.symbols[s] for s in ("n", "V", "C0", "C1"))
    return n * (V - C1) - C0


def _centrifugal_flow(m: TypeModel) -> sympy.Expr:
    """Root of dp = nu2 h0 - nu h1 Q - h2 Q2 on the falling branch."""
    nu, dp = m.symbols["n"] / m.symbols["n0"], m.symbols["dp"]
    h0, h1, h2 = (m.symbols[s] for s in ("h0", "h1", "h2"))
    return nu * (-h1 + sympy.sqrt(h1**2 + 4 * h2 * (h0 - dp / nu**2))) / (2 * h2)


def _centrifugal_slope(m: TypeModel) -> sympy.Expr:
    """Inverse of the slope of the head curve."""
    nu, h1, h2 = m.symbols["n"] / m.symbols["n0"], m.symbols["h1"], m.symbols["h2"]
    return -1 / (nu * h1 + 2 * h2 * _centrifugal_flow(m))


def _centrifugal_offset(m: TypeModel) -> sympy.Expr:
    return _centrifugal_flow(m) - _centrifugal_slope(m) * m.symbols["dp"]


def _centrifugal_power(m: TypeModel) -> sympy.Expr:
    nu, Q = m.symbols["n"] / m.symbols["n0"], _centrifugal_flow(m)
    p0, p1, p2 = (m.symbols[s] for s in ("p0", "p1", "p2"))
    return nu**3 * p0 + nu**2 * p1 * Q - nu * p2 * Q**2


LAWS: dict[str, tuple[Law, Law, Law, Law]] = {
    "dosing-pcp": (_pcp_flow, _pcp_slope, _pcp_offset, _displacement_power),
    "dosing-membrane": (_membrane_flow, _membrane_slope, _membrane_offset, _displacement_power),
    "dosing-centrifugal": (
        _centrifugal_flow, _centrifugal_slope, _centrifugal_offset, _centrifugal_power,
    ),
}  # fmt: skip
"""Flow, its slope by pressure, its offset, and power, written down by hand."""

EACH_PUMP = pytest.mark.parametrize("kind", LAWS)


def equal(a: sympy.Expr, b: sympy.Expr) -> bool:
    """Symbolic equality."""
    return bool(sympy.simplify(a - b) == 0)


def by_pressure(m: TypeModel, observer: str) -> sympy.Expr:
    """Slope of an observer by the reading of the pump's pressure."""
    return m.targets["dp"].slopes[observer]


def degree_of(m: TypeModel, fault: str, g: sympy.Expr, excess: sympy.Expr) -> sympy.Expr:
    """The degree rule of a fault with what it scales and the excess put in."""
    (rule,) = (f.rule.degree for f in m.faults if f.id == fault)
    return rule.xreplace({_real("g"): g, _real("D"): excess})


def _real(name: str) -> sympy.Symbol:
    return sympy.Symbol(name, real=True)


@EACH_PUMP
def test_pump_observer(kind: str) -> None:
    """Eq. 1 and its counterparts."""
    assert equal(LAWS[kind][0](model(kind)), model(kind).observers["pump"])


@EACH_PUMP
def test_pump_slope(kind: str) -> None:
    """Eq. 9: m_pump is the derivative of the pump observer by the pressure."""
    m = model(kind)
    assert equal(LAWS[kind][1](m), by_pressure(m, "pump"))


@EACH_PUMP
def test_linearised_pump_observer(kind: str) -> None:
    """Eqs. 8 and 10: c + m dp is the observer itself at the operating point."""
    m = model(kind)
    line = LAWS[kind][2](m) + by_pressure(m, "pump") * m.symbols["dp"]
    assert equal(m.observers["pump"], line)


@EACH_PUMP
def test_plant_observer_and_slope(kind: str) -> None:
    """Eq. 3, and m_plant = 1/(2 k2 Q_plant), which the paper does not print."""
    m = model(kind)
    dp_mod = m.symbols["dp"] - m.symbols[GATHERED + "dp_mix"]
    flow = m.observers["plant"]
    assert equal(dp_mod, m.symbols["k0"] + m.symbols["k2"] * flow**2)
    slope = 1 / (2 * m.symbols["k2"] * flow)
    assert equal(slope, by_pressure(m, "plant"))
    assert equal(-slope, m.gradients["plant"][GATHERED + "dp_mix"])
    assert equal(slope, m.targets["loss"].slopes["plant"])


def test_mixer_observer_and_slope() -> None:
    """m_resis = 1/(2 k2 Q_resis)."""
    m = model("static-mixer")
    flow = m.observers["resis"]
    assert equal(m.symbols["dp"], m.symbols["k0"] + m.symbols["k2"] * flow**2)
    for target in ("dp", "loss"):
        assert equal(1 / (2 * m.symbols["k2"] * flow), m.targets[target].slopes["resis"])


@EACH_PUMP
def test_power_observer(kind: str) -> None:
    """Eq. 2 with eta = Q_pump dp / P: Q_power = eta P_el / dp = Q_pump P_el / P."""
    m = model(kind)
    efficiency = m.observers["pump"] * m.symbols["dp"] / LAWS[kind][3](m)
    expected = efficiency * m.symbols["P_el"] / m.symbols["dp"]
    assert equal(expected, m.observers["power"])


@EACH_PUMP
def test_partial_slope_of_the_power_observer(kind: str) -> None:
    """method.md, 1.5: m_pow = Q_power (m_pump/Q_pump - P'/P)."""
    m = model(kind)
    power = LAWS[kind][3](m)
    relative = LAWS[kind][1](m) / m.observers["pump"]
    relative -= sympy.diff(power, m.symbols["dp"]) / power
    assert equal(m.observers["power"] * relative, by_pressure(m, "power"))


@EACH_PUMP
def test_partial_slope_of_the_power_observer_in_a_healthy_plant(kind: str) -> None:
    """method.md, 1.5: m_pow = m_pump - Q P'/P, where P_el is what the pump should draw."""
    m = model(kind)
    power = LAWS[kind][3](m)
    slope = by_pressure(m, "power").xreplace({m.symbols["P_el"]: power})
    loss = m.observers["pump"] * sympy.diff(power, m.symbols["dp"]) / power
    assert equal(by_pressure(m, "pump") - loss, slope)


@EACH_PUMP
def test_total_slope_of_the_power_observer(kind: str) -> None:
    """Along the pump's own power curve the power observer moves like the pump observer."""
    m = model(kind)
    along = m.observers["power"].xreplace({m.symbols["P_el"]: LAWS[kind][3](m)})
    assert equal(by_pressure(m, "pump"), sympy.diff(along, m.symbols["dp"]))


@EACH_PUMP
def test_slopes_by_electric_power(kind: str) -> None:
    """dQ_power/dP_el = Q_power/P_el, and the other observers do not read it."""
    m = model(kind)
    slopes = m.targets["P_el"].slopes
    assert {"power"} == set(slopes)
    assert equal(m.observers["power"] / m.symbols["P_el"], slopes["power"])


@EACH_PUMP
def test_leakage_rule(kind: str) -> None:
    """Eqs. 11 and 12: x = (Q_pump - Q_plant)/Q_pump = R/Q_pump."""
    m, R = model(kind), _real("R")
    found = degree_of(m, "leakage", m.observers["pump"], R)
    assert equal(R / m.observers["pump"], found)
    Q = m.observers["pump"], m.observers["plant"]
    assert equal((Q[0] - Q[1]) / Q[0], found.xreplace({R: Q[0] - Q[1]}))


@EACH_PUMP
def test_clogging_rule(kind: str) -> None:
    """Eqs. 13 to 16: D = R/(m_pump - m_plant) in the degree gives the printed rule."""
    m, R, dp_mod = model(kind), _real("R"), _real("dp_mod")
    difference = by_pressure(m, "pump") - by_pressure(m, "plant")
    found = degree_of(m, "clogging", dp_mod, R / difference)
    assert equal(R / (difference * dp_mod - R), found)


@EACH_PUMP
def test_widening_rule(kind: str) -> None:
    """Eq. 6 with the sign that gives 0 to 1: the same with the opposite sign."""
    m, R, dp_mod = model(kind), _real("R"), _real("dp_mod")
    difference = by_pressure(m, "pump") - by_pressure(m, "plant")
    found = degree_of(m, "widening", dp_mod, R / difference)
    assert equal(-R / (difference * dp_mod - R), found)


@pytest.mark.parametrize("kind", [*LAWS, "static-mixer"])
@pytest.mark.parametrize(
    ("fault", "law"),
    [("clogging", "(1 + x)*g"), ("widening", "(1 - x)*g"), ("dp.high", "(1 + x)*g"),
     ("dp.low", "(1 - x)*g")],
)  # fmt: skip
def test_degrees_undo_their_laws(kind: str, fault: str, law: str) -> None:
    """Eqs. 5 to 7: with the excess that a law makes, the rule gives back the law's degree."""
    x, g = _real("x"), _real("g")
    there = {"(1 + x)*g": (1 + x) * g, "(1 - x)*g": (1 - x) * g}[law]
    assert equal(x, degree_of(model(kind), fault, there, there - g))


@EACH_PUMP
def test_line_is_inverted(kind: str) -> None:
    """The exact form has the friction loss that belongs to a flow: k2 Q2."""
    m, Q = model(kind), _real(FLOW)
    assert equal(m.symbols["k2"] * Q**2, m.targets["loss"].inverse["plant"])
