"""Physics of lines and mixers that plain laws leave out."""

from __future__ import annotations

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, Array
from .effect import DOSING, Effect, Here, Made, middle
from .term import State

ROUNDS = 30
"""Iterations in which a hose and the pressure in it settle."""


def laminar(here: Here) -> Made:
    """A part of the loss is proportional to the flow; size is the flow, l/h, of equal parts."""
    factor = here.value("k2") * here.size * LITRE_PER_HOUR
    return here.term("loss", lambda s: factor * s.flow, a=here.size)


def exponent(here: Here) -> Made:
    """The loss has the power 2 - size of the flow; it is unchanged at the median flow."""
    usual, friction = _usual_flow(here), here.value("k2")

    def law(s: State) -> Array:
        own = np.maximum(np.abs(s.flow), 1e-3 * usual)
        return np.asarray(friction * s.flow * own * ((own / usual) ** -here.size - 1.0))

    return here.term("loss", law, power=2.0 - here.size)


def line_warm(here: Here) -> Made:
    """Friction falls as the liquid warms up."""
    return here.constant("friction", np.expm1(-2.0 * here.size * here.warmer), b=here.size)


def static_head(here: Here) -> Made:
    """The level of the feed tank changes the back-pressure of the pump; bar per m."""
    height = BAR * here.size * (here.plain("l") - here.usual("l"))
    return here.constant("loss", height, w=here.size)


def fouling(here: Here) -> Made:
    """Friction grows with time; size over the recording."""
    return here.constant("friction", here.grown, w=here.per_day)


def worn(here: Here) -> Made:
    """A throttle wears and passes more flow, at the end by the share `size`."""
    return here.constant("friction", (1.0 + here.grown) ** -2 - 1.0, w=here.per_day)


def transition(here: Here) -> Made:
    """Below a flow, `size` times the usual one, the loss is laminar, linear in the flow."""
    limit, friction = here.size * _usual_flow(here), here.value("k2")

    def law(s: State) -> Array:
        return np.asarray(friction * s.flow * np.maximum(limit - np.abs(s.flow), 0.0))

    return here.term("loss", law, p_t=friction * limit**2 / BAR)


def hose(here: Here) -> Made:
    """A hose widens under the pressure at the pump; size is the share of the flow per bar."""
    static, friction = here.value("k0"), here.value("k2")

    def law(s: State) -> Array:
        factor = np.ones_like(s.flow)
        for _ in range(ROUNDS):
            pressure = s.pressure + static + friction * factor * s.flow * np.abs(s.flow)
            factor = (1.0 + here.size * np.maximum(pressure, 0.0) / BAR) ** -2
        return np.asarray(factor - 1.0)

    return here.term("friction", law, c=here.size)


def settling(here: Here) -> Made:
    """The line passes more flow until deposits have settled; size is the share of the flow."""
    dying, tau = here.dying()
    return here.constant("friction", (1.0 + here.size * dying) ** -2 - 1.0, a=here.size, tau=tau)


def _usual_flow(here: Here) -> float:
    rig = here.scene.rig
    if here.module in rig.pumps:
        return here.usual("Q")
    feeding = [here.scene.plain[f"{n}.Q"] for n in rig.pumps if here.module in rig.path(n)]
    return middle(here.scene, np.asarray(np.sum(feeding, axis=0)))


EFFECTS = (
    Effect("static-head", "level of the feed tank", 1e-3, 0.11, static_head, kinds=DOSING,
           driver="l"),
    Effect("settling", "line passes more at first", 1e-4, 0.3, settling, kinds=DOSING, timed=True),
    Effect("laminar", "laminar part of the loss", 0.2, 900, laminar, kinds=DOSING),
    Effect("exponent", "loss with a lower power", 2e-3, 0.6, exponent, kinds=DOSING),
    Effect("line-warm", "friction falls when warm", 1e-5, 0.02, line_warm, kinds=DOSING,
           driver="T"),
    Effect("fouling", "friction grows with time", 2e-4, 0.8, fouling, kinds=DOSING, timed=True,
           slow=True),
    Effect("worn", "throttle wears", 2e-4, 0.5, worn, kinds=DOSING, timed=True, slow=True),
    Effect("hose", "hose widens", 1e-4, 0.3, hose, kinds=DOSING),
    Effect("mixer-laminar", "laminar part of the mixer", 0.2, 3000, laminar, at="mixer"),
    Effect("mixer-exponent", "mixer's loss with a lower power", 2e-3, 0.6, exponent, at="mixer"),
    Effect("mixer-transition", "mixer laminar below a flow", 0.5, 2.5, transition, at="mixer",
           corner=True),
    Effect("mixer-fouling", "mixer fouls with time", 2e-4, 1.5, fouling, at="mixer", timed=True,
           slow=True),
)  # fmt: skip
