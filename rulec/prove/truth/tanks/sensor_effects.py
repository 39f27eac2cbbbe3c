"""Errors of level sensors; their place is the tank of the sensor."""

from __future__ import annotations

from .effect import Built, Effect, Here, Make, number


def two_slope(here: Here) -> Built:
    """Above a voltage the gain is higher by the share `size`."""
    kink = here.voltage(here.between(0.3, 0.7))
    values = {"kink": (kink, "V"), "steeper": (here.size, "1")}
    return here.changed(values, kink=(kink, here.size))


def overload(here: Here) -> Built:
    """The reading keeps the share `size` of a peak above a voltage."""
    most = here.voltage(here.between(0.5, 0.8))
    values = {"overload": (most, "V"), "kept": (here.size, "1")}
    return here.changed(values, overload=(most, here.size))


def drift(sign: float) -> Make:
    """Return an effect: the zero moves by `size` volts over the recording."""

    def make(here: Here) -> Built:
        rate = sign * here.size / (here.scene.time_at(1.0) - here.scene.time_at(0.0))
        return here.changed({"drift": (3600.0 * rate, "V/h")}, drift=rate)

    return make


def stuck(here: Here) -> Built:
    """The reading is constant for a share of the recording."""
    first = here.between(0.1, 0.35)
    begin, end = (here.scene.time_at(share) for share in (first, min(first + here.size, 1.0)))
    return here.changed({"begin": (begin, "s"), "end": (end, "s")}, stuck=(begin, end))


def _error(
    name: str, title: str, low: float, high: float, make: Make, scale: float = 1.0
) -> Effect:
    return Effect(name, title, "sensor", "sensor", low, high, make, scale)


SENSOR_EFFECTS = (
    _error("offset-high", "reads high", 0.15, 1.4, number("offset", "offset", "V")),
    _error("offset-low", "reads low", 0.15, 1.4,
           number("offset", "offset", "V", lambda here: -here.size)),
    _error("gain-high", "gain too high", 0.02, 0.4, number("slope", "slope", "1")),
    _error("gain-low", "gain too low", 0.02, 0.4,
           number("slope", "slope", "1", lambda here: -here.size)),
    # The transmitter ends early, or begins late; the size is the share that it cannot show.
    _error("clipping", "highest voltage", 0.01, 0.8,
           number("limit", "limit", "V", lambda here: here.voltage(1.0 - here.size))),
    _error("live-zero", "lowest voltage", 0.01, 0.8,
           number("floor", "floor", "V", lambda here: here.voltage(here.size))),
    _error("two-slope", "gain changes at a voltage", 0.05, 1.5, two_slope),
    _error("overload", "keeps a part of peaks", 0.02, 0.6, overload),
    _error("lag", "lags", 1.0, 200.0, number("lag", "time constant", "s")),
    _error("dead-time", "shows the past", 1.0, 150.0, number("dead_time", "dead time", "s")),
    _error("hysteresis", "play", 0.1, 6.0, number("play", "width", "V")),
    _error("quantisation", "coarse steps", 0.4, 1.5, number("step", "step", "V"), 0.4),
    _error("drift-up", "drifts up", 0.2, 3.0, drift(1.0)),
    _error("drift-down", "drifts down", 0.2, 3.0, drift(-1.0)),
    _error("stuck", "stuck for a while", 0.03, 0.6, stuck),
)  # fmt: skip

# What falls in hits the cell with the square of its flow; the size is V at the usual flow.
JET = Effect("jet", "jet hits the pressure cell", "unnamed", "sensor", 0.05, 1.4,
             number("jet", "strength", "V/(cm3/s)**2",
                    lambda here: here.size / here.usual_fall**2))  # fmt: skip
"""No catalogue names it; the right answer is its place."""
