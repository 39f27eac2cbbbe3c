"""Where a curve without a name may act in a plant that stores, and what it may follow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import TIME

from rulec.effects.candidate import Candidate, Spot
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search import limits
from rulec.mismatch.search.basis import Basis


@dataclass(frozen=True)
class Place:
    """Where a curve acts, what it follows, and the ends of that, SI."""

    spot: Spot
    driver: str
    low: float
    high: float

    @property
    def knots(self) -> Array:
        """Where the curve bends, shape (knots,), SI of the driver."""
        return np.linspace(self.low, self.high, limits.CURVE_PIECES + 1)

    @cached_property
    def bends(self) -> Array:
        """From values at the knots to the coefficients of `bent_line`, shape (knots + 1, knots)."""
        count = len(self.knots)
        steps = np.diff(np.eye(count), axis=0) / (self.knots[1] - self.knots[0])
        nothing = np.zeros((1, count))
        slopes = np.vstack([nothing, steps, nothing])
        return np.vstack([np.eye(count)[:1], np.diff(slopes, axis=0)])

    def bases(self) -> list[Basis]:
        """The functions that are tried, from smooth to rough."""
        # What happens in a band of a driver may be a resonance; in a band of time, a fault.
        lengths = limits.TERM_LENGTHS[: 1 if self.driver == TIME else None]
        return [Basis(self.low, self.high, length) for length in lengths]

    def parts(self, builder: ModelBuilder) -> tuple[tuple[Candidate, ...], dict[str, float]]:
        """What builds the curve into a plant, and its knots, SI by id."""
        parts = builder.bent_line(self.spot.id, self.driver, len(self.knots))
        fixed = [u.id for part in parts for u in part.unknowns if u.fixed]
        return parts, dict(zip(fixed, self.knots.tolist(), strict=True))


def place_over(spot: Spot, driver: str, course: Array) -> Place | None:
    """A place with the range of a driver, by its course, shape (n,); None where that hardly moves.

    All of the range counts: a curve that is level beyond an end is bent by samples that pass it.
    """
    low, high = float(np.min(course)), float(np.max(course))
    if not high - low > limits.HARDLY_MOVES * float(np.max(np.abs(course))):
        return None
    return Place(spot, driver, low, high)


def spots_of(bench: SimulationProblem) -> list[Spot]:
    """Places at which a law may be off."""
    kinds = ("balance", "definition", "reading")
    return [spot for spot in bench.builder.spots if spot.kind in kinds]


def drivers_of(bench: SimulationProblem) -> list[str]:
    """What a place may follow."""
    assert bench.ruleset.dynamics is not None
    states = [s.id for s in bench.ruleset.dynamics.states]
    drivers = [*states, *bench.balances(()).inputs][: limits.FOLLOWED]
    return [*drivers, TIME] if bench.record.timed else drivers
