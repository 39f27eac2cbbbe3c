"""Laws of flow: outflow and overflow of a tank, supply of a feed. cm, s, V.

Source: Torricelli 1643 (orifice); Poleni 1717 (weir); Hagen 1839, Poiseuille 1840 (laminar part);
Streeter, Wylie, Bedford 1998 (connected tanks); affinity laws of pumps (head by square of speed);
vortex, bypass: own shapes that are in no catalogue.
"""

import math

from .feed import Feed
from .plant import Tank

GRAVITY = 981.0
"""cm/s2"""

SHARP = 2.0 / 3.0 * 0.61 * math.sqrt(2.0 * GRAVITY)
"""Strength of a sharp-crested weir per cm of its width. Source: Poleni, contraction 0.61."""

BROAD = (2.0 / 3.0) ** 1.5 * 0.9 * math.sqrt(GRAVITY)
"""Of a broad-crested one. Source: critical depth over the crest; loss 0.9."""

NEARLY_EMPTY = 1e-4
"""cm of head below which the root is smoothed, to avoid an infinite slope."""

NEARLY_LEVEL = 0.05
"""cm between two levels below which the root is smoothed, so that flow reverses smoothly."""

NEARLY_STILL = 1e-4
"""Share of a pump's head below which its flow is smoothed to zero."""

WET = 0.01
"""cm below which a floor that seeps runs dry."""

ONSET = 0.05
"""Width of the onset of a vortex as share of its flow."""


def outflow(tank: Tank, level: float, below: float, time: float) -> float:
    """Return the flow through the outlet; `below` is the next tank's level, 0 for the reservoir."""
    return _through_outlet(tank, level, below, time) + _linked(tank, level, below)


def _linked(tank: Tank, level: float, below: float) -> float:
    """Flow through a second pipe, from floor to floor, in either direction."""
    if tank.link == 0.0:
        return 0.0
    head = max(level, 0.0) - max(below, 0.0)
    return tank.link * math.sqrt(2.0 * GRAVITY) * head / math.sqrt(abs(head) + NEARLY_LEVEL)


def _through_outlet(tank: Tank, level: float, below: float, time: float) -> float:
    head = level - tank.height
    if tank.drowned is not None:
        head -= max(below - tank.drowned, 0.0)
    if head <= 0.0:
        return 0.0
    if tank.laminar > 0.0:
        turbulent = 0.5 / (GRAVITY * tank.outlet**2)
        # Root of laminar q + turbulent q**2 = head, without cancellation.
        flow = 2.0 * head / (tank.laminar + math.sqrt(tank.laminar**2 + 4.0 * turbulent * head))
    elif tank.power is not None:
        flow = tank.outlet * math.sqrt(2.0 * GRAVITY * tank.power.level)
        wet = head / tank.power.level
        flow *= wet * math.pow(wet + NEARLY_EMPTY, tank.power.exponent - 1.0)
    else:
        flow = tank.outlet * math.sqrt(2.0 * GRAVITY) * head / math.sqrt(head + NEARLY_EMPTY)
    if tank.vortex is not None:
        over = (flow / tank.vortex.flow - 1.0) / ONSET
        present = 1.0 / (1.0 + math.exp(-max(min(over, 50.0), -50.0)))
        surge = 1.0 + 0.5 * math.sin(2.0 * math.pi * time / tank.vortex.period)
        flow *= 1.0 - tank.vortex.share * present * surge
    if tank.form is not None:
        flow *= 1.0 + tank.form.at(level)
    return flow / (1.0 + tank.closing * time)


def overflow(tank: Tank, level: float) -> float:
    """Return the flow over the rim."""
    if tank.rim is None or level <= tank.rim.height:
        return 0.0
    return tank.rim.strength * math.pow(level - tank.rim.height, 1.5)


def loss(tank: Tank, level: float) -> float:
    """Return the flow that seeps or leaks out of the plant."""
    if level <= 0.0:
        return 0.0
    lost = tank.seepage * level / (level + WET)
    if tank.leak is not None:
        lost += _orifice(tank.leak.size, level)
    if tank.side is not None:
        lost += _orifice(tank.side.area, level - tank.side.height)
    return lost + _orifice(tank.drain, level)


def _orifice(area: float, head: float) -> float:
    if head <= 0.0 or area == 0.0:
        return 0.0
    return area * math.sqrt(2.0 * GRAVITY) * head / math.sqrt(head + NEARLY_EMPTY)


def supply(feed: Feed, shown: float) -> float:
    """Return the flow of a feed at a recorded input, without lag, delay and back-pressure."""
    driving = max(min(shown + feed.zero, feed.limit) - feed.dead_band, 0.0)
    asked = driving * (1.0 - feed.droop * driving) / (1.0 + feed.roll * driving)
    if feed.kink is not None:
        asked += feed.kink.steeper * max(driving - feed.kink.voltage, 0.0)
    if feed.curve is not None and driving > 0.0:
        asked *= math.pow(driving / feed.curve.voltage, feed.curve.exponent)
    if feed.lift > 0.0:
        asked = math.sqrt(max(asked**2 - feed.lift, 0.0))
    if feed.form is not None:
        asked *= 1.0 + feed.form.at(shown)
    return max(feed.gain * asked, 0.0)


def arriving(feed: Feed, flow: float, level: float, time: float) -> float:
    """Return the flow that arrives against the level of the first tank at a time, cm3/s."""
    if feed.lift_level > 0.0:
        head = (flow / feed.gain) ** 2
        left = max(head - feed.lift_level * max(level, 0.0), 0.0)
        flow *= left / math.sqrt((left + NEARLY_STILL * head) * head) if head > 0.0 else 0.0
    flow *= max(1.0 - feed.held * max(level, 0.0), 0.0) / (1.0 + feed.decline * time)
    if feed.warming is not None:
        flow *= 1.0 + feed.warming.share * math.exp(-time / feed.warming.constant)
    return flow


def bypassed(feed: Feed, flow: float) -> float:
    """Return the part of the flow, cm3/s, that misses the first tank and falls into the second."""
    if feed.bypass is None or flow <= feed.bypass.flow:
        return 0.0
    return flow * feed.bypass.share * (1.0 - math.exp(1.0 - flow / feed.bypass.flow))
