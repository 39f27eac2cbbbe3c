"""Fit balances to one window: initial states, lasting errors, and degrees of faults.

Lasting errors of parameters, inputs and sensors are unknowns with a standard normal prior. A
non-zero parameter has it on a logarithmic scale: it keeps its sign, however uncertain it is.
Correlations of parameters are neglected. Windows without a fault narrow the errors, and later ones
are judged with these.

Source: Gauss-Newton with damping (Levenberg 1944, Marquardt 1963); maximum a posteriori.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Dynamics, Ruleset
from rulec_runtime.diagnosis.steady.baseline import remembered
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.free_balances import (
    error_of,
    share_of,
    start_of,
    with_free_states,
)
from rulec_runtime.diagnosis.stores.windows import Window, jumps_of
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.simulation.balances import Balances, RanAway


@dataclass(frozen=True)
class LastingError:
    """A lasting error: `input` is its plan input, or `output` the number of the reading it shifts.

    An error of 1 multiplies `value` by exp(`size`), or adds `size` (SI) if `value` is 0.
    """

    input: str
    output: int
    value: float
    size: float

    def at(self, error: float) -> float:
        """Value at an error."""
        if self.value:
            return float(self.value * np.exp(self.size * error))
        return self.size * error

    def slope(self, error: float) -> float:
        """Derivative of the value by the error."""
        return self.size * self.at(error) if self.value else self.size


@dataclass(frozen=True)
class ErrorEstimate:
    """What is known about all errors: mean and covariance, at a time, from so many windows."""

    mean: Array
    covariance: Array
    time: float = 0.0
    windows: int = 0

    def later(self, time: float, drifts: Array) -> ErrorEstimate:
        """What is still known at a later time; `drifts` flags those that return to their prior."""
        share = np.where(drifts, remembered(time - self.time), 1.0)
        covariance = self.covariance * np.outer(share, share) + np.diag(1.0 - share**2)
        return replace(self, mean=share * self.mean, covariance=covariance, time=time)


@dataclass(frozen=True)
class Fitted:
    """A fit of a window.

    `unknowns` are initial states, SI, then lasting errors, then degrees of some faults. `error` is
    measured less shown, shape (n, outputs), SI; `states` has the shape (n, states). `information`
    and `pull`, half the second and minus half the first derivative of chi-square `chi` by the
    unknowns, include window and prior.
    """

    unknowns: Array
    chi: float
    error: Array
    states: Array
    information: Array
    pull: Array

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
    errors: tuple[LastingError, ...]
    spread: Array
    balances: Balances = field(repr=False)

    @property
    def dynamics(self) -> Dynamics:
        """The balances as the plant's file states them."""
        assert self.ruleset.dynamics is not None
        return self.ruleset.dynamics

    @property
    def states(self) -> int:
        """Number of initial states, which come first among the unknowns; errors follow."""
        return len(self.balances.states)

    @property
    def _seeds(self) -> list[str]:
        starts = [start_of(state) for state in self.balances.states]
        return [*starts, *(error.input for error in self.errors)]

    def simulate(
        self, window: Window, unknowns: Array, faults: Sequence[str] = ()
    ) -> tuple[Array, Array, Array]:
        """Outputs, their slopes by all unknowns, and the states; raises `RanAway`.

        `faults` are those whose degrees end the unknowns.
        """
        seeds = [*self._seeds, *(f"x.{fault}" for fault in faults)]
        values = {**self.dynamics.values, **dict(zip(seeds, unknowns.tolist(), strict=True))}
        own = [(i, e, float(unknowns[i])) for i, e in enumerate(self.errors, self.states)]
        values |= {e.input: e.at(x) for _, e, x in own}
        held = np.ones(window.inputs.shape[1], dtype=np.bool_)
        time = window.time - window.time[0]
        course = self.balances.run(time, window.inputs, held, values, seeds)
        shown, slopes = course.shown.copy(), course.slopes.copy()
        for column, error, x in own:
            if error.input:
                slopes[:, :, column] *= error.slope(x)
            else:
                shown[:, error.output] += error.at(x)
                slopes[:, error.output, column] = error.slope(x)
        return shown, slopes, course.states

    def at(
        self, window: Window, prior: ErrorEstimate, unknowns: Array, faults: Sequence[str] = ()
    ) -> Fitted | None:
        """How well some unknowns fit; None if they cannot be simulated."""
        try:
            shown, slopes, states = self.simulate(window, unknowns, faults)
        except RanAway:
            return None
        error = window.measured - shown
        if window.bent is not None:
            error[window.bent] = np.nan
        there, certain = np.isfinite(error), inverse(prior.covariance)
        rows, table = (error / self.spread)[there], (slopes / self.spread[:, None])[there]
        own = slice(self.states, self.states + len(self.errors))
        off = unknowns[own] - prior.mean
        chi = float(rows @ rows + off @ certain @ off)
        if not chi < limits.LARGEST_CHI_SQUARE:
            return None
        information, pull = table.T @ table, table.T @ rows
        if window.jumps is not None:
            # The moments of the jumps are unknowns as well, but nobody asks for them.
            by_jump = (window.jumps / self.spread[:, None])[there]
            shared = by_jump.T @ np.column_stack([rows, table])
            told = np.linalg.solve(np.eye(len(shared)) + by_jump.T @ by_jump, shared)
            chi -= float(shared[:, 0] @ told[:, 0])
            information -= shared[:, 1:].T @ told[:, 1:]
            pull -= shared[:, 1:].T @ told[:, 0]
            error[there] -= (window.jumps @ told[:, 0])[there]
        information[own, own] += certain
        pull[own] -= certain @ off
        return Fitted(unknowns, chi, error, states, information, pull)

    def with_jumps(self, window: Window, unknowns: Array) -> Window:
        """A window whose jumps happen in the middle between two samples, with what other moments do
        to the outputs, each by its standard deviation, at some unknowns."""
        slips = window.slips
        jumps = [] if slips is None else jumps_of(slips)
        if slips is None or not jumps:
            return window
        inputs = window.inputs.copy()
        for jump in jumps:
            inputs[jump] += 0.5 / limits.UNIFORM * slips[jump]
        window = replace(window, inputs=inputs)
        try:
            plain, _, _ = self.simulate(window, unknowns)
            moved = []
            for jump in jumps:
                changed = inputs.copy()
                changed[jump] += slips[jump]
                moved.append(self.simulate(replace(window, inputs=changed), unknowns)[0] - plain)
        except RanAway:
            return window
        return replace(window, jumps=np.stack(moved, axis=2))

    def fit(
        self, window: Window, prior: ErrorEstimate, guess: Array, faults: Sequence[str] = ()
    ) -> Fitted | None:
        """The most probable unknowns, from a guess; degrees stay in their range. None if nothing
        can be simulated."""
        specs = [self.ruleset.fault_by_id[fault] for fault in faults]
        free, damping = np.full(len(guess) - len(specs), np.inf), limits.FIRST_DAMPING
        low = np.append(-free, [spec.lowest for spec in specs])
        high = np.append(free, [s.highest * (1.0 - common.BELOW_HIGHEST) for s in specs])
        best = self.at(window, prior, guess, faults)
        for _ in range(limits.WINDOW_STEPS):
            if best is None or damping > limits.LARGEST_DAMPING:
                break
            ended = (best.unknowns <= low) & (best.pull < 0) | (best.unknowns >= high) & (
                best.pull > 0
            )
            step, own = np.zeros(len(guess)), best.information[np.ix_(~ended, ~ended)]
            step[~ended] = inverse(own + damping * np.diag(np.diag(own))) @ best.pull[~ended]
            trial = self.at(window, prior, np.clip(best.unknowns + step, low, high), faults)
            if trial is None or not trial.chi < best.chi:
                damping *= limits.MORE_DAMPING
                continue
            fall, best = best.chi - trial.chi, trial
            damping *= limits.LESS_DAMPING
            if fall < max(limits.WINDOW_SETTLED, limits.WINDOW_SLIGHT * best.chi):
                break
        return best


def model_of(ruleset: Ruleset, spread: Array, level: Array) -> Model:
    """The model of a plant with all lasting errors that affect a measured value; `spread` and the
    median `level` of each output, SI, shape (outputs,)."""
    dynamics, signals = ruleset.dynamics, ruleset.signal_by_id
    assert dynamics is not None
    balances = with_free_states(dynamics)
    reached, errors = balances.plan.used_inputs, list[LastingError]()
    for name, value in dynamics.values.items():
        u = dynamics.uncertainties[name]
        if name in reached:
            size = float(np.log1p(u / abs(value))) if value else u
            errors.append(LastingError(name, -1, value, size))
    for name in dynamics.inputs:
        u = float(systematic_u(signals[name], signals[name].reference))
        for error, size in ((error_of(name), u), (share_of(name), signals[name].standard)):
            if error in reached:
                errors.append(LastingError(error, -1, 0.0, size))
    for i, name in enumerate(dynamics.outputs):
        errors.append(LastingError("", i, 0.0, float(systematic_u(signals[name], level[i]))))
    return Model(ruleset, tuple(e for e in errors if e.size > 0.0), spread, balances)


def inverse(information: Array) -> Array:
    """Inverse of a symmetric positive matrix with entries of very different scales."""
    diagonal = np.diag(information)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = information / np.outer(size, size) + limits.LEAST_CURVATURE * np.eye(len(size))
    result: Array = np.linalg.inv(scaled) / np.outer(size, size)
    return 0.5 * (result + result.T)
