"""Fit balances to one window: initial states, lasting errors, and degrees of faults.

Source: Gauss-Newton with damping (Levenberg 1944, Marquardt 1963); maximum a posteriori.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Dynamics, Ruleset
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.errors import KnownErrors, LastingError
from rulec_runtime.diagnosis.stores.free_balances import start_of, with_free_states
from rulec_runtime.diagnosis.stores.windows import Window
from rulec_runtime.simulation.balances import Balances, RanAway


@dataclass(frozen=True)
class Guess:
    """Unknowns of a window: initial states, SI; lasting errors; degrees of some faults."""

    starts: Array
    errors: Array
    degrees: Array

    def moved(self, step: Array, low: Array, high: Array) -> Guess:
        """The unknowns after a step; degrees stay in their range."""
        a, b = len(self.starts), len(self.starts) + len(self.errors)
        degrees = np.clip(self.degrees + step[b:], low, high)
        return Guess(self.starts + step[:a], self.errors + step[a:b], degrees)


@dataclass(frozen=True)
class Fitted:
    """A fit of a window.

    `error` is measured less shown, shape (n, outputs), SI; `slopes`, shape (n, outputs, unknowns),
    are derivatives of what is shown. `information` includes window and prior.
    """

    guess: Guess
    chi: float
    error: Array
    slopes: Array
    states: Array
    information: Array

    @property
    def covariance(self) -> Array:
        """Of all unknowns."""
        return inverse(self.information)


@dataclass(frozen=True)
class Model:
    """The balances of a plant with all unknowns of a window.

    `spread` is the standard deviation that weights each output, shape (outputs,), SI.
    """

    ruleset: Ruleset
    dynamics: Dynamics
    errors: tuple[LastingError, ...]
    spread: Array
    balances: Balances = field(repr=False)

    @staticmethod
    def of(ruleset: Ruleset, errors: Sequence[LastingError], spread: Array) -> Model:
        """The model of a plant."""
        assert ruleset.dynamics is not None
        return Model(
            ruleset, ruleset.dynamics, tuple(errors), spread, with_free_states(ruleset.dynamics)
        )

    def simulate(
        self, window: Window, guess: Guess, faults: Sequence[str] = ()
    ) -> tuple[Array, Array, Array]:
        """Outputs, their slopes by all unknowns, and the states; raises `RanAway`.

        `faults` are those of the degrees of the guess.
        """
        balances, inputs = self.balances, window.inputs
        starts = [start_of(s) for s in balances.states]
        values = dict(self.dynamics.values)
        values |= dict(zip(starts, guess.starts.tolist(), strict=True))
        own = [(e, x) for e, x in zip(self.errors, guess.errors.tolist(), strict=True)]
        values |= {e.input: e.at(x) for e, x in own if e.input}
        degrees = [f"x.{f}" for f in faults]
        values |= dict(zip(degrees, guess.degrees.tolist(), strict=True))
        seeds = [*starts, *(e.input for e in self.errors), *degrees]
        time = window.time - window.time[0]
        held = np.ones(inputs.shape[1], dtype=np.bool_)
        course = balances.run(time, inputs, held, values, seeds)
        shown, slopes = course.shown.copy(), course.slopes.copy()
        for place, (error, x) in enumerate(own, len(starts)):
            if error.input:
                slopes[:, :, place] *= error.slope(x)
            else:
                shown[:, error.output] += error.at(x)
                slopes[:, error.output, place] = error.slope(x)
        return shown, slopes, course.states

    def fit(
        self, window: Window, known: KnownErrors, guess: Guess, faults: Sequence[str] = ()
    ) -> Fitted | None:
        """The most probable unknowns, from a guess; None if nothing can be simulated."""
        specs = [self.ruleset.fault_by_id[f] for f in faults]
        low = np.array([s.lowest for s in specs])
        high = np.array([s.highest * (1.0 - common.BELOW_HIGHEST) for s in specs])
        certain = inverse(known.covariance)
        best = self._tried(window, known, certain, guess, faults)
        damping = limits.FIRST_DAMPING
        for _ in range(limits.WINDOW_STEPS):
            if best is None:
                return None
            step = self._step(window, known, certain, best, damping, low, high)
            trial = self._tried(window, known, certain, best.guess.moved(step, low, high), faults)
            if trial is not None and trial.chi < best.chi:
                fall = best.chi - trial.chi
                best, damping = trial, damping * limits.LESS_DAMPING
                if fall < max(limits.WINDOW_SETTLED, limits.WINDOW_SLIGHT * best.chi):
                    break
            else:
                damping *= limits.MORE_DAMPING
                if damping > limits.LARGEST_DAMPING:
                    break
        return best

    def _tried(
        self,
        window: Window,
        known: KnownErrors,
        certain: Array,
        guess: Guess,
        faults: Sequence[str],
    ) -> Fitted | None:
        try:
            shown, slopes, states = self.simulate(window, guess, faults)
        except RanAway:
            return None
        error = window.measured - shown
        rows, table = self.rows(error), self.rows_of_slopes(error, slopes)
        a, b = len(guess.starts), len(guess.starts) + len(guess.errors)
        information = table.T @ table
        information[a:b, a:b] += certain
        off = guess.errors - known.mean
        chi = float(rows @ rows + off @ certain @ off)
        if not chi < limits.LARGEST_CHI_SQUARE:
            return None
        return Fitted(guess, chi, error, slopes, states, information)

    def rows(self, error: Array) -> Array:
        """Errors where something was measured, in standard deviations, shape (known,)."""
        return np.asarray((error / self.spread)[np.isfinite(error)])

    def rows_of_slopes(self, error: Array, slopes: Array) -> Array:
        """Slopes of the outputs with the same weights, shape (known, unknowns)."""
        return np.asarray((slopes / self.spread[:, None])[np.isfinite(error)])

    def _step(
        self,
        window: Window,
        known: KnownErrors,
        certain: Array,
        at: Fitted,
        damping: float,
        low: Array,
        high: Array,
    ) -> Array:
        table, rows = self.rows_of_slopes(at.error, at.slopes), self.rows(at.error)
        a, b = len(at.guess.starts), len(at.guess.starts) + len(at.guess.errors)
        pull = table.T @ rows
        pull[a:b] -= certain @ (at.guess.errors - known.mean)
        free = np.ones(len(pull), dtype=bool)
        ended = (at.guess.degrees <= low) & (pull[b:] < 0) | (at.guess.degrees >= high) & (
            pull[b:] > 0
        )
        free[b:] = ~ended
        step = np.zeros(len(pull))
        own = at.information[np.ix_(free, free)]
        step[free] = inverse(own + damping * np.diag(np.diag(own))) @ pull[free]
        return step


def inverse(information: Array) -> Array:
    """Inverse of a symmetric positive matrix with entries of very different scales."""
    diagonal = np.diag(information)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = information / np.outer(size, size) + limits.LEAST_CURVATURE * np.eye(len(size))
    result: Array = np.linalg.inv(scaled) / np.outer(size, size)
    return 0.5 * (result + result.T)
