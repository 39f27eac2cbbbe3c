"""Fit the coefficients of kb/fluids/ to CoolProp: `python -m tests.kb.fit_fluids` prints them.

Done once; the knowledge base holds the rounded result, and CoolProp is never needed to compile.
The largest relative deviation over the range is made small (Lawson's reweighted least squares).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Array = NDArray[np.float64]
Law = Callable[[Array, Array], Array]
T0 = 293.15
PRESSURE = 2e5
ROUNDS = 60


@dataclass(frozen=True)
class Liquid:
    """A liquid of CoolProp over a range in degC; `terms` of the polynomial of its density."""

    coolprop: str
    lowest: float
    highest: float
    terms: int


LIQUIDS = {
    "water": Liquid("Water", 0.1, 95.0, 4),
    "meg-30": Liquid("INCOMP::MEG[0.30]", -10.0, 95.0, 3),
    "meg-50": Liquid("INCOMP::MEG[0.50]", -20.0, 95.0, 3),
    "mpg-30": Liquid("INCOMP::MPG[0.30]", -10.0, 95.0, 3),
}


def temperatures(liquid: Liquid, count: int = 200) -> Array:
    """Temperatures over the range, shape (count,), K."""
    return np.linspace(liquid.lowest, liquid.highest, count) + 273.15


def tabulated(liquid: Liquid, letter: str, T: Array) -> Array:
    """Density (letter D, kg/m3) or viscosity (V, Pa s) by CoolProp, shape of T."""
    from CoolProp.CoolProp import PropsSI  # slow to import

    return np.array([PropsSI(letter, "T", t, "P", PRESSURE, liquid.coolprop) for t in T])


def polynomial(p: Array, T: Array) -> Array:
    """Density, kg/m3: r0 + r1 (T - T0) + r2 (T - T0)2 + ..."""
    return np.polynomial.polynomial.polyval(T - T0, p)


def vogel(p: Array, T: Array) -> Array:
    """Viscosity, Pa s: A exp(B/(T - C)). Source: Vogel 1921."""
    return p[0] * np.exp(p[1] / (T - p[2]))


def fit(law: Law, begin: Array, T: Array, values: Array) -> tuple[Array, float]:
    """Coefficients and their largest relative deviation."""
    weights, best, least = np.ones_like(T), begin, np.inf
    at = begin
    for _ in range(ROUNDS):
        at = least_squares(
            lambda p, w=weights: w * (law(p, T) / values - 1), at, x_scale=np.abs(begin), xtol=1e-14
        ).x
        error = np.abs(law(at, T) / values - 1)
        if error.max() < least:
            best, least = at, error.max()
        weights = weights * (error / error.max() + 0.05) ** 0.5
        weights /= weights.max()
    return best, float(least)


def fit_liquid(liquid: Liquid) -> dict[str, tuple[Array, float]]:
    """Coefficients of density and viscosity, each with its largest relative deviation."""
    T = temperatures(liquid)
    start = np.array([1e3, -0.4, -3e-3, 1e-5][: liquid.terms])
    return {
        "density": fit(polynomial, start, T, tabulated(liquid, "D", T)),
        "viscosity": fit(vogel, np.array([3e-5, 550.0, 150.0]), T, tabulated(liquid, "V", T)),
    }


if __name__ == "__main__":
    for name, liquid in LIQUIDS.items():
        for quantity, (coefficients, deviation) in fit_liquid(liquid).items():
            numbers = ", ".join(f"{c:.7g}" for c in coefficients)
            print(f"{name} {quantity}: {numbers}   within {deviation:.2e}")
