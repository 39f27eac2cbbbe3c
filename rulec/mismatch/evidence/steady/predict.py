"""Predict a reading from the others, for errors in units that a user understands.

A residual of the ruleset is solved for one of its readings, so that its error has the unit of that
signal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ResidualSpec, SignalSpec
from rulec_runtime.recordings.reading_unit import parse_unit

from rulec.algebra.tangent import run_with_slopes
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.system import System
from rulec.simulation.predict_settled import is_flow


@dataclass(frozen=True)
class Predictor:
    """A residual and the reading it is solved for; `points` flags those where it can be used."""

    system: System
    residual: ResidualSpec
    signal: SignalSpec
    points: np.ndarray

    @property
    def of_flow(self) -> bool:
        """Is the reading a volume flow?"""
        return is_flow(self.signal, self.system.ruleset)

    def predicted(self, setting: Configuration) -> Array:
        """The reading by a model, shape (n,), SI; NaN where there is none."""
        measured = self.system.data.values[self.signal.id]
        at = measured.copy()
        spread, largest = np.nanstd(measured[self.points]), np.nanmax(np.abs(measured))
        size = max(float(spread), 1e-6 * float(largest))
        settled = np.full(len(at), np.inf)
        for _ in range(limits.PREDICTOR_STEPS):
            value, slope = self._value(setting, at)
            with np.errstate(all="ignore"):
                step = np.clip(-value / slope, -10.0 * size, 10.0 * size)
            # Where the law has no value the iteration stays at the reading, which is no prediction.
            known = np.isfinite(step)
            at = np.where(known, at + step, at)
            settled = np.where(known, np.abs(step), np.inf)
            if np.max(settled[self.points & known], initial=0.0) < 1e-9 * size:
                break
        return np.where(self.points & (settled < 1e-3 * size), at, np.nan)

    def _value(self, setting: Configuration, at: Array) -> tuple[Array, Array]:
        """The residual at a value of the reading, and its slope by the reading."""
        system = self.system
        inputs = system.corrected(setting)
        error = system.error_at(self.signal.id, setting)
        inputs[self.signal.id] = at - error * system.shared.get(self.signal.id, np.zeros(1))
        value, slope = np.zeros(len(at)), np.zeros(len(at))
        for term in self.residual.terms:
            spec = system.ruleset.observer_by_id[term.observer]
            plan = system.builder.plan(spec.module, setting.ids, system.built_in(setting))
            key = f"q:{term.observer}"
            out, slopes = run_with_slopes(plan.select([key]), inputs, (self.signal.id,))
            value = value + term.sign * out[key]
            slope = slope + term.sign * slopes[key].get(self.signal.id, np.zeros(1))
        return value, slope

    def noise(self, setting: Configuration) -> Array:
        """Standard uncertainty of measured less predicted, by the noise of all readings, shape
        (n,)."""
        system = self.system
        flows = system.flows(setting)
        variance, own = np.zeros(len(system.data)), np.zeros(len(system.data))
        for name, slopes in flows.by_reading.items():
            total = np.zeros(len(system.data))
            for term in self.residual.terms:
                i = system.number[term.observer]
                total = total + term.sign * slopes.get(i, np.zeros(1))
            with np.errstate(invalid="ignore"):  # an estimate without a slope has no noise
                variance += (total * system.data.noise[name]) ** 2
            if name == self.signal.id:
                own = total
        with np.errstate(all="ignore"):
            return np.asarray(np.sqrt(variance) / np.abs(own))


def predictors_for(
    system: System, observers: tuple[str, ...], drivers: frozenset[str], unit: str = ""
) -> list[Predictor]:
    """Residuals and readings that show the error of some observers, the most natural first.

    A reading of the dimension of the place (`unit`) is best, then one of only one side of the
    residual, such as that of a flow meter.
    """
    kind = parse_unit(unit, system.ruleset.units)
    modules = {o.rpartition(".")[0] for o in observers}
    found: dict[str, tuple[tuple[float, ...], Predictor]] = {}
    for spec in system.ruleset.residuals:
        ids = [t.observer for t in spec.terms]
        touched = [o for o in ids if o in observers]
        if not touched or not all(o in system.number for o in ids):
            continue
        points = _usable(system, spec)
        for name in sorted({s for o in ids for s in system.ruleset.observer_by_id[o].signals}):
            signal = system.ruleset.signal_by_id[name]
            readers = [o for o in ids if name in system.ruleset.observer_by_id[o].signals]
            if signal.is_input or points.sum() < 3:
                continue
            own = parse_unit(signal.unit, system.ruleset.units)
            alike = kind is not None and own is not None and kind.dimension == own.dimension
            rank = (
                float(alike),
                float(name.partition(".")[0] in modules),
                float(name not in drivers),
                float(len(readers) == 1),
                float(len(touched) < len(ids)),
                -float(len(ids)),
                -float(len(system.ruleset.observer_by_id[readers[0]].signals)),
                float(readers[0] not in observers),
            )
            if name not in found or rank > found[name][0]:
                found[name] = (rank, Predictor(system, spec, signal, points))
    ranked = sorted(found.values(), key=lambda f: f[0], reverse=True)
    return [predictor for _, predictor in ranked]


def predictor_of(system: System, relation: str, name: str) -> Predictor:
    """A residual, by its id, solved for a reading."""
    spec = next(s for s in system.ruleset.residuals if s.id == relation)
    points = _usable(system, spec)
    return Predictor(system, spec, system.ruleset.signal_by_id[name], points)


def _usable(system: System, spec: ResidualSpec) -> np.ndarray:
    """Points at which all estimates of a residual may be used, shape (n,)."""
    return np.asarray(np.all(system.valid[[system.number[t.observer] for t in spec.terms]], axis=0))
