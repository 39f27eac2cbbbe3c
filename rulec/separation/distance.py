"""Distance between two faults at some operating points.

The readings of a plant with one fault are simulated without errors of sensors. The other fault is
then undone in them as in a diagnosis, at the degree that fits all points best. The remaining
chi-square accounts for noise, systematic errors of sensors, the calibration and the tolerance of
the law. Its root is the distance in standard deviations; half of it is the expected logarithm of
the Bayes factor between the two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady.degree_search import Outcomes, fit
from rulec_runtime.diagnosis.steady.hypothesis import stacked_test
from rulec_runtime.diagnosis.steady.observe import Observed, observe
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.limits import BELOW_HIGHEST, BEYOND_CALIBRATED, STATISTICAL_SHARE
from rulec_runtime.recordings.stationary import systematic_u

from rulec.separation.limits import STEP_SECONDS
from rulec.separation.propose import Looked, Point
from rulec.simulation.equations import Equations
from rulec.simulation.simulate import simulate_with

SOUND, PRESENT = 0, 1
"""Indices of the first two points: the present one without the fault, and with it."""


Case = tuple[FaultSpec, float, FaultSpec]
"""A present fault with its degree, and another one that it may be taken for."""


@dataclass(frozen=True)
class Faulty:
    """A plant with one fault at n operating points.

    `possible`, shape (n,): the plant runs there, and no reading leaves its range. `flows` per
    module, shape (n,), m3/s.
    """

    observed: Observed
    possible: np.ndarray
    flows: Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class FaultMeasure:
    """Measures the distance of faults at a point and the present one together.

    `present` is the reading, SI, of each signal that no equation determines. The smallest distance
    of the cases in each of `rows` counts. With `baseline`, the present point was also recorded
    without a fault. Readings must stay within `bounds`, SI.
    """

    equations: Equations
    present: Mapping[str, float]
    rows: Sequence[Sequence[Case]]
    baseline: bool = False
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def __call__(self, points: Sequence[Point]) -> Looked:
        apart = np.full((len(self.rows), len(points)), np.inf)
        flows: Mapping[str, Array] = {}
        for row, cases in zip(apart, self.rows, strict=True):
            for fault, degree, other in cases:
                truth = self._faulty(points, fault, degree)
                flows = flows or {name: v[2:] for name, v in truth.flows.items()}
                for i, point in enumerate(points):
                    there, square = [PRESENT, 2 + i] if point else [PRESENT], np.nan
                    # The present point counts even if readings leave their ranges.
                    if truth.possible[there[1:]].all():
                        fitted = self._undone(truth, other, there)
                        square = np.nan if fitted is None else float(fitted.distance[0, 0])
                    # Rounding may make the distance of a perfect fit negative.
                    row[i] = np.minimum(row[i], np.sqrt(np.maximum(square, 0.0)))
        return Looked(np.where(np.isfinite(apart), apart, np.nan), flows)

    def degree_of(self, other: FaultSpec, fault: FaultSpec, degree: float) -> float:
        """The degree at which another fault looks most like this one at the present point."""
        fitted = self._undone(self._faulty([{}], fault, degree), other, [PRESENT])
        return 0.0 if fitted is None else _legal(other, float(fitted.degree[0, 0, 0]))

    def _faulty(self, points: Sequence[Point], fault: FaultSpec, degree: float) -> Faulty:
        """The plant at the present point, without the fault and with it, and at others with it;
        readings are means over the time for which a set point is held."""
        n, ruleset = 2 + len(points), self.equations.ruleset
        given = {name: np.full(n, value) for name, value in self.present.items()}
        for i, point in enumerate(points, 2):
            for name, value in point.items():
                own = ruleset.signal_by_id[name]
                given[name][i] = value * own.factor + own.offset
        degrees = np.full(n, _legal(fault, degree))
        degrees[SOUND] = 0.0
        simulated = simulate_with(self.equations, given, {fault.id: degrees})
        possible = simulated.solved.copy()
        values, u, systematic = {}, {}, {}
        for signal in (s for s in ruleset.signals if s.id in simulated.values):
            shown = np.broadcast_to(simulated.values[signal.id], (n,))
            values[signal.id] = shown
            systematic[signal.id] = systematic_u(signal, shown) + np.zeros(n)
            noise = STATISTICAL_SHARE * systematic[signal.id] / np.sqrt(STEP_SECONDS)
            u[signal.id] = np.hypot(systematic[signal.id], noise)
            ranges = [signal.ends, self.bounds.get(signal.id, signal.ends)]
            if signal.minimum is not None:
                ranges.append((signal.minimum, np.inf))
            low, high = signal.valid_from, signal.valid_to
            # A fault may move what it scales out of the calibrated range, as in a diagnosis.
            if low is not None and high is not None and signal.id not in fault.scales:
                slack = BEYOND_CALIBRATED * (high - low)
                ranges.append((low - slack, high + slack))
            with np.errstate(invalid="ignore"):
                for least, most in ranges:
                    possible &= (shown >= least) & (shown <= most)
        bad = {name: np.zeros(n, dtype=bool) for name in values}
        readings = Points(values, u, systematic, bad, {}, np.zeros(n))
        return Faulty(observe(ruleset, readings), possible, simulated.flows)

    def _undone(self, truth: Faulty, other: FaultSpec, points: list[int]) -> Outcomes | None:
        """The fit of another fault; None if no estimate that is valid at all points shows it."""
        members = np.array([SOUND, *points] if self.baseline else points)[:, None]
        ruleset, observed = self.equations.ruleset, truth.observed
        valid = np.asarray(observed.valid[:, members[:, 0]].all(axis=1))
        test = stacked_test(ruleset, observed, valid, members, (members != SOUND).astype(float))
        if not test.freedom or not test.touched((other,)):
            return None
        return fit(test, [(other,)])


def _legal(fault: FaultSpec, degree: float) -> float:
    return float(np.clip(degree, fault.lowest, fault.highest * (1.0 - BELOW_HIGHEST)))
