"""Volume balances, integrated from sample to sample and from jump to jump of a flow.

Source: conservation of volume; LSODA (Petzold 1983) as in scipy. Its `odeint` restarts at every
sample five times faster than `solve_ivp`, whose LSODA also leaks 2 kB each time (1.17).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import odeint

from ..units import Array
from .drive import path, with_play
from .laws import arriving, bypassed, loss, outflow, overflow, supply
from .plant import Plant, Tank

RELATIVE, ABSOLUTE = 1e-7, 1e-7
"""Tolerances; levels are of the order of 10 cm."""

MOST_STEPS = 20000
"""Of an interval; a tank that runs empty takes some hundreds."""

SOLVED = "Integration successful."
"""Report of scipy on success."""

SAME = 1e-6
"""s; closer times are one."""


@dataclass(frozen=True)
class Course:
    """The course of a plant at n samples.

    Attributes
    ----------
    time : s; `levels`, shape (n, tanks), cm; `fed` : flow of the feed at its end, cm3/s
    fallen, left : inflow of each tank and outflow by its outlet, shape (n, tanks), cm3/s
    sensed : level that each sensor shows, after its lag and dead time, shape (n, sensors), cm
    pumped, drained, lost : volumes since the beginning, shape (n,), cm3
    """

    time: Array
    levels: Array
    fed: Array
    fallen: Array
    left: Array
    sensed: Array
    pumped: Array
    drained: Array
    lost: Array


def integrate(plant: Plant, time: Array, shown: Array) -> Course:
    """Simulate the plant; an input holds from its sample to the next."""
    moved = with_play(shown, plant.feed.play) if plant.feed.play else shown
    drive = path(time, moved, plant.feed.rate)
    stops, sampled = _stops(plant, time, [] if drive.stepped else drive.times)
    states = np.empty((len(stops), len(_start(plant, 0.0))))
    flows = np.empty((len(stops), 1 + 2 * len(plant.tanks)))
    states[0] = _start(plant, supply(plant.feed, float(shown[0])))
    for i, (begin, end) in enumerate(pairwise(stops.tolist())):
        middle = 0.5 * (begin + end)
        tanks = tuple(t.at(middle) for t in plant.tanks)
        # Before the first sample the input was as at the first. Within an interval the drive
        # stands still, or moves linearly.
        ends = (begin, end) if not drive.stepped else (middle, middle)
        first, last = (drive.at(t - plant.feed.delay) for t in ends)
        given = supply(plant.feed, first)
        flows[i] = _flows(plant, tanks, begin, states[i].tolist(), given)

        def rates(
            t: float,
            x: Sequence[float],
            tanks: tuple[Tank, ...] = tanks,
            line: tuple[float, float, float, float] = (begin, first, end, last),
            given: float = given,
        ) -> list[float]:
            since, one, until, other = line
            if one != other:
                set_ = one + (other - one) * (t - since) / (until - since)
                given = supply(plant.feed, set_)
            return _rates(plant, tanks, t, x, given)

        solved, report = odeint(
            lambda t, x, rates=rates: rates(t, x.tolist()),
            states[i],
            (begin, end),
            tfirst=True,
            rtol=RELATIVE,
            atol=ABSOLUTE,
            mxstep=MOST_STEPS,
            full_output=True,
        )
        if report["message"] != SOLVED:
            raise RuntimeError(f"not solved from {begin} s on: {report['message']}")
        states[i + 1] = solved[-1]
    given = supply(plant.feed, last)
    flows[-1] = _flows(plant, tanks, float(stops[-1]), states[-1].tolist(), given)
    return _course(plant, stops, sampled, states, flows)


def _stops(plant: Plant, time: Array, corners: Sequence[float]) -> tuple[Array, NDArray[np.intp]]:
    """Times at which something jumps, turns or is read, and the indices of samples among them."""
    begins = [f.begin for t in plant.tanks for f in (t.leak, t.clog) if f is not None]
    turns = np.asarray(corners, dtype=np.float64) + plant.feed.delay
    delayed = [turns, *([time + plant.feed.delay] if plant.feed.delay else [])]
    read = [time - s.dead_time for s in plant.sensors if s.dead_time]
    between = np.concatenate([*delayed, *read, np.array(begins)])
    between = between[(between > time[0]) & (between < time[-1])]
    above = np.searchsorted(time, between)
    near = np.minimum(time[above] - between, between - time[above - 1])
    stops = np.unique(np.concatenate([time, between[near > SAME]]))
    return stops, np.flatnonzero(np.isin(stops, time))


def _start(plant: Plant, given: float) -> list[float]:
    """Levels, states of lagging sensors and of the feed, volume stored by air, three volumes."""
    sensed = [plant.tank(s.tank).level for s in plant.sensors]
    stored = [plant.feed.pocket * given**2] if plant.feed.pocket else []
    return [*(t.level for t in plant.tanks), *sensed, given, *stored, 0.0, 0.0, 0.0]


def _flows(
    plant: Plant, tanks: Sequence[Tank], time: float, state: Sequence[float], given: float
) -> list[float]:
    """Flow of the feed, inflow of each tank, outflow of each by its outlet."""
    count = len(tanks)
    fed = _driven(plant, state, given)
    if plant.feed.pocket:
        fed = math.sqrt(max(_stored(plant, state), 0.0) / plant.feed.pocket)
    fed = arriving(plant.feed, fed, state[0], time)
    falls = [0.0] * (count + 1)
    missed = bypassed(plant.feed, fed)
    falls[0] += fed - missed
    falls[1] += missed
    leaves = []
    for i, tank in enumerate(tanks):
        below = state[i + 1] if i + 1 < count else 0.0
        leaves.append(outflow(tank, state[i], below, time))
        caught = tank.rim.caught * overflow(tank, state[i]) if tank.rim else 0.0
        falls[i + 1] += leaves[i] + caught
    return [fed, *falls[:count], *leaves]


def _driven(plant: Plant, state: Sequence[float], given: float) -> float:
    """Flow of the feed after its lag."""
    return state[len(plant.tanks) + len(plant.sensors)] if plant.feed.lag else given


def _stored(plant: Plant, state: Sequence[float]) -> float:
    return state[len(plant.tanks) + len(plant.sensors) + 1]


def _rates(
    plant: Plant, tanks: Sequence[Tank], time: float, state: Sequence[float], given: float
) -> list[float]:
    count = len(tanks)
    fed, *others = _flows(plant, tanks, time, state, given)
    falls, leaves = others[:count], others[count:]
    rates, lost, drained = [], 0.0, 0.0
    for i, tank in enumerate(tanks):
        over, away = overflow(tank, state[i]), loss(tank, state[i])
        rates.append((falls[i] - leaves[i] - over - away) / tank.surface(state[i]))
        caught = tank.rim.caught * over if tank.rim else 0.0
        lost += away + over - caught
        drained = leaves[i] + caught
    for j, sensor in enumerate(plant.sensors):
        level = state[[t.name for t in tanks].index(sensor.tank)]
        rates.append((level - state[count + j]) / sensor.lag if sensor.lag else 0.0)
    lagging = state[count + len(plant.sensors)]
    rates.append((given - lagging) / plant.feed.lag if plant.feed.lag else 0.0)
    if plant.feed.pocket:
        let_out = math.sqrt(max(_stored(plant, state), 0.0) / plant.feed.pocket)
        rates.append(_driven(plant, state, given) - let_out)
    return [*rates, fed, drained, lost]


def _course(
    plant: Plant, stops: Array, sampled: NDArray[np.intp], states: Array, flows: Array
) -> Course:
    """The course at the samples among all stops, and the levels that sensors show."""
    count, time = len(plant.tanks), stops[sampled]
    names = [t.name for t in plant.tanks]
    sensed = np.empty((len(time), len(plant.sensors)))
    for j, sensor in enumerate(plant.sensors):
        followed = states[:, count + j if sensor.lag else names.index(sensor.tank)]
        sensed[:, j] = np.interp(time - sensor.dead_time, stops, followed)
    picked, flow = states[sampled], flows[sampled]
    return Course(
        time,
        picked[:, :count],
        flow[:, 0],
        flow[:, 1 : count + 1],
        flow[:, count + 1 :],
        sensed,
        picked[:, -3],
        picked[:, -2],
        picked[:, -1],
    )
