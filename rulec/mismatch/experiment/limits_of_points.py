"""What limits say of operating points: which may be run, what they cost, how long they take."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset

from rulec.limits import SAME_FLOW
from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.admissible_points import Reach
from rulec.mismatch.experiment.foretell import Foretold, Places


@dataclass(frozen=True)
class Within:
    """Places of which the last is the present one, and what limits say of each.

    `possible`, shape (n,): each explanation foretells it, and no reading leaves its sensor.
    `forbidden` per reading with limits, shape (n,): where it may leave them. `costs` names per
    place the inputs and modules that cost product. `unwatched` are readings with limits that no
    explanation foretells. Each place is held `held` times as long as it has to be at least; the way
    to the first one begins at the place `begun`.
    """

    places: Places
    reach: Reach
    possible: NDArray[np.bool_]
    forbidden: Mapping[str, NDArray[np.bool_]]
    costs: tuple[tuple[str, ...], ...]
    unwatched: tuple[str, ...]
    held: int = 1
    begun: int = -1

    @property
    def may_run(self) -> NDArray[np.bool_]:
        """Places that keep all limits, shape (n,)."""
        none = np.zeros(len(self.possible), dtype=bool)
        keeps: NDArray[np.bool_] = self.possible & ~np.any([none, *self.forbidden.values()], axis=0)
        return keeps

    def times(self, places: Sequence[int]) -> list[tuple[float, float]]:
        """For each of some places in turn, how long the way there takes at least, and how long it
        is held, s."""
        ways = zip([self.begun, *places], places, strict=False)
        hold = self.held * self.shortest
        return [(self._ramp(before, place), hold) for before, place in ways]

    def seconds(self, places: Sequence[int]) -> float:
        """How long some places take in turn, s."""
        return sum(ramp + hold for ramp, hold in self.times(places))

    def at_end(self, place: int) -> Iterator[tuple[str, str]]:
        """Inputs that are at an end of what may be set there: its name, and which end."""
        for name in self.reach.ranges:
            values = self.places.inputs[name][:-1]
            value = self.places.inputs[name][place]
            if value in (values.min(), values.max()):
                yield name, "lowest" if value == values.min() else "highest"

    def _ramp(self, before: int, place: int) -> float:
        if self.reach.allowed is None:
            return 0.0
        return max(
            abs(float(values[place] - values[before])) / abs(own.signal.factor) / own.rate
            for name, own in self.reach.allowed.inputs.items()
            for values in [self.places.inputs.get(name, np.zeros(len(self.places)))]
        )

    @property
    def shortest(self) -> float:
        """How long a place is held at least, s."""
        own = () if self.reach.allowed is None else self.reach.allowed.inputs.values()
        return max([self.reach.step, *(part.hold for part in own)])


def within(ruleset: Ruleset, places: Places, reach: Reach, told: Sequence[Foretold]) -> Within:
    """What limits say of places, by what each explanation foretells of them."""
    possible = np.ones(len(places), dtype=bool)
    possible[-1] = False
    for true, one in enumerate(told):
        settled = np.zeros(len(places), dtype=bool)
        settled[one.point] = True
        settled[one.point[np.abs(one.off[true]) > limits.FORETOLD_WELL]] = False
        possible &= settled
        for name, values in one.readings.items():
            signal = ruleset.signal_by_id[name]
            low, high = signal.ends
            least = low if signal.minimum is None else max(low, signal.minimum)
            with np.errstate(invalid="ignore"):
                possible &= (values >= least) & (values <= high)
    bounds = {} if reach.allowed is None else dict(reach.allowed.readings)
    known = {n: b for n, b in bounds.items() if all(n in one.readings for one in told)}
    return Within(
        places=places,
        reach=reach,
        possible=possible,
        forbidden={name: _leaves(told, name, ends) for name, ends in known.items()},
        costs=tuple(_costs(places, reach, told, place) for place in range(len(places))),
        unwatched=tuple(sorted(bounds.keys() - known.keys())),
    )


def _leaves(told: Sequence[Foretold], name: str, ends: tuple[float, float]) -> NDArray[np.bool_]:
    """Where a reading may leave its limits under any explanation; so it may where none foretells
    it."""
    leaves = np.zeros(len(told[0].readings[name]), dtype=bool)
    for one in told:
        value, far = one.readings[name], limits.COVERED * one.spread[name]
        with np.errstate(invalid="ignore"):
            leaves |= ~((value - far >= ends[0]) & (value + far <= ends[1]))
    return leaves


def _costs(places: Places, reach: Reach, told: Sequence[Foretold], place: int) -> tuple[str, ...]:
    """Inputs and modules of which a change from the present point costs product."""
    if reach.allowed is None:
        return ()
    moved = [
        name
        for name, own in reach.allowed.inputs.items()
        if own.costs and name in reach.ranges
        if not math.isclose(places.inputs[name][place], places.inputs[name][-1])
    ]
    flows = [
        module
        for module in sorted(reach.allowed.costly)
        if any(_moves(one.flows.get(module), place) for one in told)
    ]
    return (*moved, *flows)


def _moves(flow: Array | None, place: int) -> bool:
    """Does a flow change? One that is not known may."""
    return flow is None or not abs(flow[place] - flow[-1]) <= SAME_FLOW * abs(flow[-1])
