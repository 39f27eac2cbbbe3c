"""Beside LSODA (scipy) and CVODE (SUNDIALS, scikit-sundae): two tanks, with exact derivatives.

Their rates are equations and derivatives by hand, compiled by numba. The voltage is held from
sample to sample, so every solver starts anew at each sample, as it has to where inputs jump.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array

from tests.bench.row import Row, median
from tests.states.plants import SHIPPED, random_inputs
from tests.states.test_integrator import BY_HAND, lower, run, values_of

SAMPLES, RTOL, ATOL = 1024, 1e-6, 1e-9
AGREE = 1e-4
"""Volts of ten."""

Solve = Callable[[Array, float, float, float], Array]


def rows() -> list[Row]:
    """Levels and their derivatives by seven parameters."""
    rates = _rates()
    time, u = random_inputs(SAMPLES)
    values = values_of(SHIPPED)
    ours = median(lambda: run(time, u, values, *BY_HAND), 15)
    expected = lower(run(time, u, values, *BY_HAND))
    found = []
    for key, peer, solve in (
        ("lsoda", "LSODA (scipy)", _lsoda(rates)),
        ("cvodes", "CVODE (scikit-sundae)", _cvode(rates)),
    ):
        course = stepped(solve, time, u)
        np.testing.assert_allclose(SHIPPED["gain"] * course[:, 1], expected, rtol=0, atol=AGREE)
        found.append(
            Row(
                key=key,
                what=f"two tanks over {SAMPLES} samples, with 7 derivatives",
                peer=peer,
                ours=ours,
                theirs=median(lambda solve=solve: stepped(solve, time, u), 3),
                same=f"rates compiled by numba; readings agree to {AGREE:g} V",
                differs="called from Python for each sample there, in one loop here",
            )
        )
    return found


def stepped(solve: Solve, time: Array, u: Array) -> Array:
    """States at all samples, shape (n, 16): two levels, then their derivatives."""
    y = np.concatenate([[SHIPPED["h0"]] * 2, np.zeros(14)])
    y[2 + 5], y[2 + 7 + 6] = 1.0, 1.0
    states = [y]
    for begin, end, now in zip(time[:-1], time[1:], u[:-1], strict=True):
        states.append(solve(states[-1], begin, end, now))
    return np.array(states)


def _rates() -> Any:
    """Rates of levels and of their derivatives, by hand."""
    from numba import njit

    v = SHIPPED
    gravity, area, a, k = v["gravity"], v["A"], v["a"], v["k"]

    @njit
    def rates(y: Array, now: float, out: Array) -> None:
        fall_1 = np.sqrt(2.0 * gravity * max(y[0], 1e-12))
        fall_2 = np.sqrt(2.0 * gravity * max(y[1], 1e-12))
        out[0] = (k * now - a * fall_1) / area
        out[1] = (a * fall_1 - a * fall_2) / area
        for j in range(7):
            upper = a * gravity / fall_1 * y[2 + j]
            under = a * gravity / fall_2 * y[9 + j]
            if j == 2:
                upper += fall_1
            if j == 4:
                under += fall_2
            out[2 + j] = -upper / area
            out[9 + j] = (upper - under) / area
        out[2] += now / area
        out[3] -= out[0] / area
        out[12] -= out[1] / area

    return rates


def _lsoda(rates: Any) -> Solve:
    from scipy.integrate import odeint

    def solve(y: Array, begin: float, end: float, now: float) -> Array:
        def called(y: Array, _: float) -> Array:
            out = np.empty(16)
            rates(y, now, out)
            return out

        # The Fortran loop itself: `solve_ivp` would add its own Python to each step.
        return np.asarray(odeint(called, y, (begin, end), rtol=RTOL, atol=ATOL)[-1])

    return solve


def _cvode(rates: Any) -> Solve:
    from sksundae.cvode import CVODE

    held = np.zeros(1)

    def called(_: float, y: Array, out: Array) -> None:
        rates(y, held[0], out)

    solver = CVODE(called, method="Adams", rtol=RTOL, atol=ATOL)

    def solve(y: Array, begin: float, end: float, now: float) -> Array:
        held[0] = now
        return np.asarray(solver.solve(np.array([begin, end]), y).y[-1])

    return solve
