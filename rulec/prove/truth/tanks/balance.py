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
from .plant import Plant, law

RELATIVE, ABSOLUTE = 1e-7, 1e-7
"""Tolerances; levels are of the order of 10 cm."""

MOST_STEPS = 20000
"""Of an interval; a tank that runs empty takes some hundreds."""

SOLVED = "Integration successful."
"""Report of scipy on success."""

SAME = 1e-6
"""s; closer times are one."""

Line = tuple[float, float, float, float, float]
"""Course of an input: time and value at its beginning and end, and the supply at its beginning."""


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


class Balances:
    """The balances of a plant; states are levels, sensors with a lag, the flow after the lag of
    the feed, the volume that air stores (with a pocket only), and three volumes of `Course`."""

    def __init__(self, plant: Plant) -> None:
        self.feed, self.supply = plant.feed, law("supply", plant.feed)
        self.arrival = law("arrival", plant.feed)
        self.tanks = [(law("flows", tank), tank) for tank in plant.tanks.values()]
        tanks = plant.layout.tanks
        self.sensors = [(tanks.index(name), s["lag"]) for name, s in plant.sensors.items()]
        self.lagging = len(self.tanks) + len(self.sensors)

    def start(self, shown: float) -> list[float]:
        """Return the states at the beginning, settled at an input."""
        given, levels = self.supply(shown), [tank["start"] for _, tank in self.tanks]
        stored = [self.feed["pocket"] * given**2] if self.feed["pocket"] else []
        return [*levels, *(levels[i] for i, _ in self.sensors), given, *stored, 0.0, 0.0, 0.0]

    def flows(
        self, time: float, state: Sequence[float], middle: float, line: Line
    ) -> tuple[list[float], list[float]]:
        """Return the flow of the feed at its end, the inflow of each tank, and the outflow of each
        by its outlet; and the rates of all states."""
        feed, count, rates = self.feed, len(self.tanks), list[float]()
        begin, first, end, last, given = line
        if first != last:
            given = self.supply(first + (last - first) * (time - begin) / (end - begin))
        flow = driven = state[self.lagging] if feed["lag"] else given
        if feed["pocket"]:
            flow = math.sqrt(max(state[self.lagging + 1], 0.0) / feed["pocket"])
        fed, missed = self.arrival(flow, state[0], time)
        falls, leaves = [fed - missed, missed, *[0.0] * (count - 1)], []
        lost = drained = 0.0
        for i, (law_, tank) in enumerate(self.tanks):
            below = state[i + 1] if i + 1 < count else 0.0
            left, over, away, surface = law_(state[i], below, time, middle)
            caught = tank["caught"] * over
            rates.append((falls[i] - left - over - away) / surface)
            lost += away + over - caught
            drained = left + caught
            falls[i + 1] += drained
            leaves.append(left)
        for j, (i, lag) in enumerate(self.sensors, start=count):
            rates.append((state[i] - state[j]) / lag if lag else 0.0)
        rates.append((given - state[self.lagging]) / feed["lag"] if feed["lag"] else 0.0)
        if feed["pocket"]:
            rates.append(driven - flow)
        return [fed, *falls[:count], *leaves], [*rates, fed, drained, lost]

    def rates(self, time: float, x: Array, middle: float, line: Line) -> list[float]:
        """Return the rates of all states; x has shape (states,)."""
        return self.flows(time, x.tolist(), middle, line)[1]


def integrate(plant: Plant, time: Array, shown: Array) -> Course:
    """Simulate the plant; an input holds from its sample to the next."""
    balances, feed = Balances(plant), plant.feed
    moved = with_play(shown, feed["play"]) if feed["play"] else shown
    drive = path(time, moved, feed["rate"])
    stops, sampled = _stops(plant, time, [] if drive.stepped else drive.times)
    states = [np.array(balances.start(float(shown[0])))]
    flows = []
    for begin, end in pairwise(stops.tolist()):
        middle = 0.5 * (begin + end)
        # Before the first sample the input was as at the first. Within an interval the drive
        # stands still, or moves linearly.
        ends = (middle, middle) if drive.stepped else (begin, end)
        first, last = (drive.at(t - feed["delay"]) for t in ends)
        line = begin, first, end, last, balances.supply(first)
        flows.append(balances.flows(begin, states[-1].tolist(), middle, line)[0])
        solved, report = odeint(
            balances.rates,
            states[-1],
            (begin, end),
            args=(middle, line),
            tfirst=True,
            rtol=RELATIVE,
            atol=ABSOLUTE,
            mxstep=MOST_STEPS,
            full_output=True,
        )
        if report["message"] != SOLVED:
            raise RuntimeError(f"not solved from {begin} s on: {report['message']}")
        states.append(solved[-1])
    line = begin, last, end, last, balances.supply(last)
    flows.append(balances.flows(end, states[-1].tolist(), middle, line)[0])
    return _course(plant, stops, sampled, np.array(states), np.array(flows))


def _stops(plant: Plant, time: Array, corners: Sequence[float]) -> tuple[Array, NDArray[np.intp]]:
    """Times at which something jumps, turns or is read, and the indices of samples among them."""
    delay = plant.feed["delay"]
    begins = [tank[f"{fault}_begin"] for tank in plant.tanks.values() for fault in ("leak", "clog")]
    delayed = [np.array(corners, dtype=np.float64) + delay, time + delay]
    read = [time - sensor["dead_time"] for sensor in plant.sensors.values()]
    between = np.concatenate([*delayed, *read, np.array(begins)])
    between = between[(between > time[0]) & (between < time[-1])]
    above = np.searchsorted(time, between)
    near = np.minimum(time[above] - between, between - time[above - 1])
    stops = np.unique(np.concatenate([time, between[near > SAME]]))
    return stops, np.flatnonzero(np.isin(stops, time))


def _course(
    plant: Plant, stops: Array, sampled: NDArray[np.intp], states: Array, flows: Array
) -> Course:
    """The course at the samples among all stops, and the levels that sensors show."""
    names, time = plant.layout.tanks, stops[sampled]
    count = len(names)
    sensed = []
    for j, (tank, sensor) in enumerate(plant.sensors.items(), start=count):
        followed = states[:, j if sensor["lag"] else names.index(tank)]
        sensed.append(np.interp(time - sensor["dead_time"], stops, followed))
    picked, flow = states[sampled], flows[sampled]
    return Course(
        time,
        picked[:, :count],
        flow[:, 0],
        flow[:, 1 : count + 1],
        flow[:, count + 1 :],
        np.stack(sensed, 1),
        *picked[:, -3:].T,
    )
