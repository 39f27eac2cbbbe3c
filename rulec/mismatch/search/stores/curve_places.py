"""Possible places and drivers of a curve without a name in a plant that stores."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import TIME

from rulec.effects.candidate import Candidate, DisturbanceLocation
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search import limits
from rulec.mismatch.search.basis import Basis


@dataclass(frozen=True)
class Place:
    """The place of a curve, its driver, and the range of that, SI."""

    spot: DisturbanceLocation
    driver: str
    low: float
    high: float

    @property
    def knots(self) -> Array:
        """Values of the driver at which the curve bends, shape (knots,), SI."""
        return np.linspace(self.low, self.high, limits.CURVE_PIECES + 1)

    @cached_property
    def bends(self) -> Array:
        """Map from values at the knots to the coefficients of `bent_line`, shape (knots + 1,
        knots)."""
        values = np.eye(len(self.knots))
        steps = np.diff(values, axis=0) / (self.knots[1] - self.knots[0])
        slopes = np.pad(steps, ((1, 1), (0, 0)))
        return np.vstack([values[:1], np.diff(slopes, axis=0)])

    def bases(self) -> list[Basis]:
        """The functions to try, from smooth to rough."""
        # An effect in a band of a driver may be a resonance; in a band of time it is a fault.
        lengths = limits.TERM_LENGTHS[: 1 if self.driver == TIME else None]
        return [Basis(self.low, self.high, length) for length in lengths]

    def parts(self, builder: ModelBuilder) -> tuple[tuple[Candidate, ...], dict[str, float]]:
        """Candidates that add the curve to a plant, and its knots, SI by id."""
        parts = builder.bent_line(self.spot.id, self.driver, len(self.knots))
        fixed = [u.id for part in parts for u in part.unknowns if u.fixed]
        return parts, dict(zip(fixed, self.knots.tolist(), strict=True))


def place_over(spot: DisturbanceLocation, driver: str, course: Array) -> Place | None:
    """A place with the range of a driver, by its course, shape (n,); None if that hardly moves.

    The whole range counts: samples beyond the knots would distort a curve that is constant there.
    """
    low, high = float(np.min(course)), float(np.max(course))
    if not high - low > limits.HARDLY_MOVES * float(np.max(np.abs(course))):
        return None
    return Place(spot, driver, low, high)


def spots_of(bench: SimulationProblem) -> list[DisturbanceLocation]:
    """Places at which a law may have an error."""
    kinds = ("balance", "definition", "reading")
    return [spot for spot in bench.builder.spots if spot.kind in kinds]


def drivers_of(bench: SimulationProblem) -> list[str]:
    """Possible drivers of a place."""
    assert bench.ruleset.dynamics is not None
    states = [s.id for s in bench.ruleset.dynamics.states]
    drivers = [*states, *bench.balances(()).inputs][: limits.FOLLOWED]
    return [*drivers, TIME] if bench.record.timed else drivers
