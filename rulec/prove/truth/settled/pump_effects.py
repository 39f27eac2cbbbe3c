"""Physics of pumps, their motors and drives that plain laws leave out."""

from __future__ import annotations

import numpy as np

from ..units import BAR, LITRE_PER_HOUR, RPM, Array
from .effect import DISPLACEMENT, DOSING, STROKES, Effect, Here, Made, Make, middle
from .term import State

HALVINGS = 40


def slip_warm(here: Here) -> Made:
    """Laminar gaps: the slip follows the fluidity, which rises with the temperature."""
    rise = np.expm1(here.size * here.warmer)
    return here.term("slip", lambda s: s.slip * rise, b=here.size)


def slip_laminar(here: Here) -> Made:
    """Slip proportional to the pressure; size in l/h/bar."""
    factor = here.size * LITRE_PER_HOUR / BAR
    return here.term("slip", lambda s: factor * s.pressure, C=here.size)


def slip_gap(here: Here) -> Made:
    """Gaps widen with the pressure, and the slip rises with their cube; size per bar."""
    return here.term(
        "slip", lambda s: s.slip * ((1.0 + here.size * s.pressure / BAR) ** 3 - 1.0), c=here.size
    )


def relief(here: Here) -> Made:
    """A relief valve opens; size in l/h/bar."""
    opens, factor = here.limit("dp", 0.7, 0.93), here.size * LITRE_PER_HOUR / BAR

    def law(s: State) -> Array:
        return factor * np.maximum(s.pressure - opens, 0.0)

    return here.term("slip", law, K=here.size, p_open=opens / BAR)


def gas(here: Here) -> Made:
    """Gas in the liquid is compressed; inlet at 1 bar absolute."""
    return here.term("gain", lambda s: here.size * s.pressure / (s.pressure + BAR), x=here.size)


def compressed(here: Here) -> Made:
    """The stroke is shortened by elastic parts; size per bar."""
    return here.term("gain", lambda s: here.size * s.pressure / BAR, beta=here.size)


def valve_delay(here: Here) -> Made:
    """Valves close late in every stroke; size in ms."""
    return here.term("gain", lambda s: 1e-3 * here.size * s.speed, tau=here.size)


def filling(here: Here) -> Made:
    """The pump does not fill above a speed."""
    limit = here.limit("n", 0.65, 0.9)
    values = {"k": here.size, "n_c": limit / RPM}
    return here.term("gain", lambda s: here.size * np.maximum(s.speed / limit - 1.0, 0.0), **values)


def starved(here: Here) -> Made:
    """The pump draws air when its tank is nearly empty."""
    limit = here.limit("l", 0.15, 0.4)
    short = np.maximum(1.0 - here.plain("l") / limit, 0.0)
    return here.constant("gain", here.size * short, k=here.size, l_c=limit)


def belt(here: Here) -> Made:
    """Motor slip or a belt: the shaft turns slower under load; size at the median pressure."""
    usual = here.usual("dp")
    return here.term("shaft", lambda s: here.size * s.pressure / usual, s=here.size)


def speed_limit(here: Here) -> Made:
    """The drive does not follow its set value above a speed."""
    shown, limit = here.plain("n"), here.limit("n", 0.65, 0.9)
    share = here.size * np.maximum(shown - limit, 0.0) / shown
    return here.constant("shaft", share, a=here.size, n_c=limit / RPM)


def warm_up_slip(here: Here) -> Made:
    """The cold pump slips less, or more, until it is warm."""
    dying, tau = here.dying()
    signed = here.signed()
    course = signed * dying
    return here.term("slip", lambda s: s.slip * course, a=signed, tau=tau)


def wear(here: Here) -> Made:
    """Gaps wear; size is the growth over the recording."""
    return here.term("slip", lambda s: s.slip * here.grown, w=here.per_day)


def head_warm(here: Here) -> Made:
    """The head of a centrifugal pump changes as the liquid warms up."""
    factor = np.expm1(-here.size * here.warmer)
    return here.term("head", lambda s: s.pressure * factor, b=here.size)


def head_wear(here: Here) -> Made:
    """Head lost with time; size over the recording."""
    return here.term("head", lambda s: s.pressure * here.grown, w=here.per_day)


def head_speed(here: Here) -> Made:
    """The head rises with another power of the speed than 2."""
    ratio = here.plain("n") / here.usual("n")
    factor = ratio**-here.size - 1.0
    return here.term("head", lambda s: s.pressure * factor, a=here.size)


def copper(here: Here) -> Made:
    """Copper loss rises with the square of torque, hence of pressure; size at median load."""
    usual, load = here.usual("dp"), here.usual("P_el")
    return here.term("power", lambda s: here.size * load * (s.pressure / usual) ** 2, k=here.size)


def by_speed(power: int) -> Make:
    """Return an effect: motor friction rises with a power of the speed; size at median load."""

    def make(here: Here) -> Made:
        usual, load = here.usual("n"), here.usual("P_el")
        return here.term(
            "power", lambda s: here.size * load * (s.speed / usual) ** power, k=here.size
        )

    return make


def power_warm(here: Here) -> Made:
    """The power falls as the liquid warms up."""
    factor = np.expm1(-here.size * here.warmer)
    return here.term("power", lambda s: s.power * factor, b=here.size)


def friction_warm(here: Here) -> Made:
    """The idle power falls as the liquid warms up."""
    factor = np.expm1(-here.size * here.warmer)
    return here.term("power", lambda s: s.idle * factor, b=here.size)


def warm_up_power(here: Here) -> Made:
    """Cold bearings and seals take more power until they are warm."""
    dying, tau = here.dying()
    course = here.size * dying
    return here.term("power", lambda s: s.power * course, a=here.size, tau=tau)


def slip_power(here: Here) -> Made:
    """Gaps are less laminar than in the law: a lower power of the pressure."""
    usual, more = here.usual("dp"), -here.size
    return here.term(
        "slip", lambda s: s.slip * ((np.maximum(s.pressure, 1.0) / usual) ** more - 1.0), m=more
    )


def slip_dragged(here: Here) -> Made:
    """The moving walls drag liquid against the slip, or with it, by a power of the speed."""
    usual, more = here.usual("n"), here.signed()
    return here.term("slip", lambda s: s.slip * ((s.speed / usual) ** more - 1.0), a=more)


def heated(here: Here) -> Made:
    """Dissipation warms the liquid in the pump above the thermometer's reading, K."""
    power = here.plain("P_el")
    colder = here.size * power / middle(here.scene, power)
    return here.reading("T", lambda shown: shown - colder, r=here.size)


def induction(here: Here) -> Made:
    """The slip of an asynchronous motor depends on the torque only, at any speed."""
    usual, lag = here.usual("dp"), here.size * here.usual("n")
    return here.term("shaft", lambda s: lag * s.pressure / usual / s.speed, s=here.size)


def weakened(here: Here) -> Made:
    """Above the speed at its largest voltage a motor slips more, with the square of the speed."""
    usual, limit = here.usual("dp"), here.limit("n", 0.4, 0.7)

    def law(s: State) -> Array:
        beyond = np.maximum((s.speed / limit) ** 2 - 1.0, 0.0)
        return np.asarray(here.size * s.pressure / usual * beyond)

    return here.term("shaft", law, s=here.size, n_c=limit / RPM)


def folded_back(here: Here) -> Made:
    """Above a power the converter reduces the speed; the power is that at the lower speed."""
    limit, kind = here.limit("P_el", 0.4, 0.8), here.scene.rig.kind(here.module)
    lead = f"{here.module}."
    own = {n.removeprefix(lead): v for n, v in here.scene.values.items() if n.startswith(lead)}

    def law(s: State) -> Array:
        low, high = np.zeros_like(s.speed), np.full_like(s.speed, 0.9)
        for _ in range(HALVINGS):
            share = 0.5 * (low + high)
            power = kind.power(own, s.speed * (1.0 - share), s.pressure, s.flow)
            more = here.size * np.maximum(power / limit - 1.0, 0.0) > share
            low, high = np.where(more, share, low), np.where(more, high, share)
        return np.asarray(0.5 * (low + high))

    return here.term("shaft", law, s=here.size, P_c=limit)


def stribeck(here: Here) -> Made:
    """Seals rub while no film carries them: a torque that decays with the speed."""
    usual, load = here.usual("n"), here.usual("P_el")
    reach = here.between(0.15, 0.5) * usual

    def law(s: State) -> Array:
        return np.asarray(here.size * load * s.speed / usual * np.exp(-s.speed / reach))

    return here.term("power", law, e=reach / usual)


def power_speed(here: Here) -> Made:
    """The power rises with another power of the speed than in the affinity laws."""
    usual, more = here.usual("n"), here.signed()
    return here.term("power", lambda s: s.power * ((s.speed / usual) ** more - 1.0), a=more)


CENTRIFUGAL = ("centrifugal",)
EFFECTS = (
    Effect("slip-warm", "slip follows the temperature", 1e-4, 0.08, slip_warm,
           kinds=DISPLACEMENT, driver="T"),
    Effect("slip-laminar", "slip linear in pressure", 0.02, 80, slip_laminar, kinds=("cavity",)),
    Effect("slip-gap", "gaps widen with pressure", 1e-4, 1.0, slip_gap, kinds=DISPLACEMENT),
    Effect("relief", "relief valve opens", 0.05, 2000, relief, kinds=DISPLACEMENT, corner=True),
    Effect("gas", "gas in the liquid", 1e-4, 0.3, gas, kinds=STROKES),
    Effect("compressed", "stroke shortened by pressure", 1e-5, 0.05, compressed, kinds=STROKES),
    Effect("valve-delay", "valves close late", 0.05, 60, valve_delay, kinds=("membrane",)),
    Effect("filling", "does not fill at high speed", 1e-3, 2.5, filling, kinds=STROKES,
           corner=True),
    Effect("starved", "draws air at low level", 1e-3, 0.6, starved, kinds=DOSING, driver="l",
           corner=True),
    Effect("belt", "shaft slower under load", 1e-4, 0.15, belt, kinds=STROKES),
    Effect("speed-limit", "drive does not follow", 5e-3, 1.0, speed_limit, kinds=DOSING,
           corner=True),
    Effect("warm-up-slip", "slip until warm", 5e-3, 0.9, warm_up_slip, kinds=DISPLACEMENT,
           timed=True),
    Effect("wear", "slip grows with time", 5e-3, 3.0, wear, kinds=DISPLACEMENT, timed=True,
           slow=True),
    Effect("head-warm", "head rises with temperature", 1e-5, 0.02, head_warm, kinds=CENTRIFUGAL,
           driver="T"),
    Effect("head-wear", "head lost with time", 2e-4, 0.3, head_wear, kinds=CENTRIFUGAL, timed=True,
           slow=True),
    Effect("head-speed", "head not by the square of speed", 1e-3, 0.8, head_speed,
           kinds=CENTRIFUGAL),
    Effect("copper", "copper loss", 1e-3, 0.6, copper, kinds=DISPLACEMENT),
    Effect("windage", "fan of the motor", 1e-3, 0.8, by_speed(3), kinds=DOSING),
    Effect("viscous", "viscous friction", 1e-3, 0.8, by_speed(2), kinds=DOSING),
    Effect("power-warm", "power falls with temperature", 1e-5, 0.02, power_warm, driver="T"),
    Effect("friction-warm", "idle power falls with temperature", 1e-4, 0.06, friction_warm,
           kinds=DISPLACEMENT, driver="T"),
    Effect("warm-up-power", "more power until warm", 1e-3, 0.6, warm_up_power, timed=True),
    Effect("slip-power", "slip by another power", 2e-3, 1.5, slip_power, kinds=DISPLACEMENT),
    Effect("slip-dragged", "slip by the speed", 2e-3, 1.5, slip_dragged, kinds=STROKES),
    Effect("heated", "liquid warmer than shown", 0.01, 40.0, heated, kinds=("oil-warm",)),
    Effect("induction", "motor slips with its torque", 1e-4, 0.15, induction, kinds=DOSING),
    Effect("weakened", "motor beyond its voltage", 1e-3, 0.2, weakened, kinds=STROKES, corner=True),
    Effect("folded-back", "converter limits the power", 1e-3, 0.8, folded_back, kinds=STROKES,
           corner=True),
    Effect("stribeck", "seals rub at low speed", 5e-3, 5.0, stribeck, kinds=STROKES),
    Effect("power-speed", "power by another power of speed", 2e-3, 1.8, power_speed,
           kinds=("centrifugal", "metered")),
)  # fmt: skip
