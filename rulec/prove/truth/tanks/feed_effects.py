"""Effects of the feed of the first tank: a pump by its voltage, or a pipe with a flow meter."""

from __future__ import annotations

from .effect import Built, Effect, Here, number, quantile
from .feed import Bypass, Curve, Kink, Warming


def rate(here: Here) -> Built:
    """The drive takes `size` seconds to reach the usual voltage."""
    return here.changed({"running time": (here.size, "s")}, rate=here.usual_input / here.size)


def pocket(here: Here) -> Built:
    """Air in the line is compressed; `size` is the time constant at the usual flow."""
    stored = 0.5 * here.size / quantile(here.scene.course.fed, 0.5)
    return here.changed({"time constant": (here.size, "s")}, pocket=stored)


def per_volt(here: Here) -> float:
    """Return the curvature of the flow; `size` is the missing share at the highest voltage (of the
    remaining flow, if it levels off)."""
    return here.size / float(here.scene.setup.shown.max())


def upturn(here: Here) -> Built:
    """Above a voltage the flow is steeper by the share `size`."""
    voltage = quantile(here.scene.setup.shown, here.between(0.25, 0.6))
    values = {"voltage": (voltage, "V"), "steeper": (here.size, "1")}
    return here.changed(values, kink=Kink(voltage, here.size))


def exponent(here: Here) -> Built:
    """The flow follows a power of the voltage."""
    own = here.size * float(here.random.choice([-0.6, 1.0]))
    return here.changed({"exponent": (own, "1")}, curve=Curve(own, here.usual_input))


def warm_up(here: Here) -> Built:
    """The cold pump delivers more, or less, by the share `size`."""
    share = here.size * float(here.random.choice([-0.6, 1.0]))
    constant = here.between(0.1, 0.35) * here.record
    values = {"share": (share, "1"), "time constant": (constant, "s")}
    return here.changed(values, warming=Warming(share, constant))


def bypass(here: Here) -> Built:
    """A strong jet of the feed partly misses the first tank."""
    falling = here.scene.falling(here.scene.setup.layout.tanks[0])
    # If a feed is off for long, the quantile is zero.
    flow = max(quantile(falling, here.between(0.1, 0.4)), 0.1 * float(falling.max()))
    values = {"flow": (flow, "cm3/s"), "share": (here.size, "1")}
    return here.changed(values, bypass=Bypass(flow, here.size))


FEED_EFFECTS = (
    # The first volts move nothing.
    Effect("dead-band", "dead band", "physics", "feed", 0.02, 3.0,
           number("dead_band", "dead band", "V")),
    # More voltage gives no more flow; the size is how often that would be asked for.
    Effect("saturation", "saturation", "physics", "feed", 0.01, 0.9,
           number("limit", "limit", "V", lambda h: quantile(h.scene.setup.shown, 1.0 - h.size))),
    Effect("droop", "flow bends down with the input", "physics", "feed", 0.01, 0.45,
           number("droop", "droop", "1/V", per_volt)),
    Effect("lag", "flow lags", "physics", "feed", 1.0, 200.0, number("lag", "time constant", "s")),
    # A long hose runs partly empty: all flow arrives later.
    Effect("delay", "flow is delayed", "physics", "feed", 1.0, 150.0,
           number("delay", "delay", "s")),
    Effect("play", "drive has play", "physics", "feed", 0.02, 4.0, number("play", "width", "V")),
    Effect("rate", "drive moves slowly", "physics", "feed", 1.0, 600.0, rate),
    Effect("pocket", "air in the line", "physics", "feed", 1.0, 300.0, pocket),
    # It feeds below the surface; the size is the share of the flow lost at the usual level.
    Effect("held", "level holds the pump back", "physics", "feed", 0.02, 0.8,
           number("held", "share", "1/cm", lambda here: here.size / here.usual_first)),
    # A part of the head; the size is its share at the usual voltage, and at the usual level.
    Effect("lift", "pump lifts to a height", "physics", "feed", 0.005, 0.8,
           number("lift", "height", "V2", lambda here: here.size * here.usual_input**2)),
    Effect("lift-level", "pump lifts against the level", "physics", "feed", 0.01, 0.9,
           number("lift_level", "height", "V2/cm",
                  lambda here: here.size * here.usual_input**2 / here.usual_first)),
    Effect("roll-off", "flow levels off", "physics", "feed", 0.02, 4.0,
           number("roll", "bend", "1/V", per_volt)),
    Effect("upturn", "second, steeper slope", "physics", "feed", 0.02, 2.0, upturn),
    Effect("exponent", "flow by a power", "physics", "feed", 0.02, 0.8, exponent),
    # The pump wears; the size is the share over the record.
    Effect("decline", "flow declines", "physics", "feed", 0.01, 1.0,
           number("decline", "growth", "1/s", lambda here: here.size / here.record)),
    Effect("warm-up", "flow until warm", "physics", "feed", 0.02, 0.8, warm_up),
)  # fmt: skip

BYPASS = Effect("bypass", "jet misses the first tank", "unnamed", "feed", 0.05, 1.0, bypass)
"""No catalogue names it; the right answer is its place."""
