"""Fit balances to one window: initial states, lasting errors, and degrees of faults.

Lasting errors of parameters, inputs and sensors are unknowns with a standard normal prior. A
non-zero parameter has it on a logarithmic scale: it keeps its sign, however uncertain it is.
Correlations of parameters are neglected. Windows without a fault narrow the errors, and later ones
are judged with these.

Source: Gauss-Newton with damping (Levenberg 1944, Marquardt 1963); maximum a posteriori.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
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
from rulec_runtime.diagnosis.stores.windows import Window, input_errors
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.simulation.balances import Balances, Course, RanAway


@dataclass(frozen=True)
class LastingError:
    """A lasting error: `input` is its plan input, or `output` the number of the reading it shifts.

    An error of 1 multiplies `value` by exp(`size`), or adds `size` (SI) if `value` is 0. That of a
    `law` adds the share `size` to its formula at knot number `knot` of its range. What `drifts`
    returns to 0 in the long run, what is `new` differs from window to window.
    """

    input: str
    output: int
    value: float
    size: float
    drifts: bool = False
    law: str = ""
    knot: int = 0
    new: bool = False

    def at(self, error: float) -> float:
        """Value at an error."""
        if self.value:
            return float(self.value * np.exp(min(self.size * error, limits.LARGEST_EXPONENT)))
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

    def later(self, time: float, errors: Sequence[LastingError]) -> ErrorEstimate:
        """What is still known of all errors at a later time."""
        kept = float(remembered(time - self.time))
        share = np.array([0.0 if e.new else kept if e.drifts else 1.0 for e in errors])
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

    `spread` is the standard deviation that weights each output, shape (outputs,), SI; `spans` the
    least and largest value of each law whose form may be off, SI.
    """

    ruleset: Ruleset
    errors: tuple[LastingError, ...]
    spread: Array
    balances: Balances = field(repr=False)
    spans: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def dynamics(self) -> Dynamics:
        """The balances as the plant's file states them."""
        assert self.ruleset.dynamics is not None
        return self.ruleset.dynamics

    @property
    def states(self) -> int:
        """Number of initial states, which come first among the unknowns; errors follow."""
        return len(self.balances.states)

    def simulate(
        self, window: Window, unknowns: Array, faults: Sequence[str] = ()
    ) -> tuple[Array, Array, Array]:
        """Outputs, their slopes by all unknowns, and the states; raises `RanAway`.

        `faults` are those whose degrees end the unknowns.
        """
        starts = [start_of(state) for state in self.balances.states]
        names = [*starts, *(e.input for e in self.errors), *(f"x.{fault}" for fault in faults)]
        seeded = [i for i, name in enumerate(names) if name]
        seeds = [names[i] for i in seeded]
        course = self.run(self.balances, window, unknowns, faults, seeds)
        shown, slopes = course.shown, np.zeros((*course.shown.shape, len(names)))
        slopes[:, :, seeded] = course.slopes
        for column, error in enumerate(self.errors, self.states):
            x = float(unknowns[column])
            if error.input:
                slopes[:, :, column] *= error.slope(x)
            elif not error.law:
                shown[:, error.output] += error.at(x)
                slopes[:, error.output, column] = error.slope(x)
        if window.forms is not None:
            own = [i for i, error in enumerate(self.errors, self.states) if error.law]
            shown += window.forms @ unknowns[own]
            slopes[:, :, own] = window.forms
        return shown, slopes, course.states

    def run(
        self,
        balances: Balances,
        window: Window,
        unknowns: Array,
        faults: Sequence[str] = (),
        seeds: Sequence[str] = (),
    ) -> Course:
        """The course of some balances, without errors of sensors and forms; raises `RanAway`."""
        held = np.ones(window.inputs.shape[1], dtype=np.bool_)
        time = window.time - window.time[0]
        return balances.run(time, window.inputs, held, self._values(unknowns, faults), seeds)

    def _values(self, unknowns: Array, faults: Sequence[str] = ()) -> dict[str, float]:
        """Numbers that the balances read, at some unknowns."""
        ends = [start_of(state) for state in self.balances.states], [f"x.{f}" for f in faults]
        values = dict(self.dynamics.values)
        values |= zip(ends[0], unknowns[: self.states].tolist(), strict=True)
        values |= zip(ends[1], unknowns[self.states + len(self.errors) :].tolist(), strict=True)
        own = zip(self.errors, unknowns[self.states :].tolist(), strict=False)
        return values | {e.input: e.at(x) for e, x in own if e.input}

    def laws_of(self, window: Window, unknowns: Array) -> dict[str, Array]:
        """Values of all laws whose form may be off, at some unknowns, SI, shape (n,) each; raises
        `RanAway`."""
        dynamics = self.dynamics
        course = self.run(self.balances, window, unknowns).states
        plan = dynamics.plan.select(f"law:{law}" for law in dynamics.forms)
        states = zip((s.id for s in dynamics.states), course.T, strict=True)
        inputs = zip(dynamics.inputs, window.inputs.T, strict=True)
        nothing = dict.fromkeys(plan.inputs, 0.0)
        values = {**nothing, **self._values(unknowns), **dict(states), **dict(inputs)}
        found = plan.run(values)
        return {law: np.broadcast_to(found[f"law:{law}"], window.time.shape) for law in self.spans}

    def with_errors(self, window: Window, unknowns: Array) -> Window:
        """A window with what errors of inputs and the form of laws do to its outputs."""
        return self.with_forms(self.with_input_errors(window, unknowns), unknowns)

    def with_forms(self, window: Window, unknowns: Array) -> Window:
        """A window with what the form of each law does to its outputs, each knot by its standard
        deviation, at some unknowns."""
        if not self.spans:
            return window
        balances = with_free_states(self.dynamics, tuple(f"form.{law}" for law in self.spans))
        course, columns = np.zeros((len(window.time), len(self.spans))), list[Array]()
        try:
            laws = self.laws_of(window, unknowns)
            own = replace(window, inputs=np.column_stack([window.inputs, course]))
            plain = self.run(balances, own, unknowns).shown
            for i, (law, value) in enumerate(laws.items(), window.inputs.shape[1]):
                knots, hats = np.linspace(*self.spans[law], limits.KNOTS), np.eye(limits.KNOTS)
                size = self.dynamics.forms[law]
                for hat in hats:
                    moved = replace(own, inputs=own.inputs.copy())
                    moved.inputs[:, i] = size * value * np.interp(value, knots, hat)
                    columns.append((self.run(balances, moved, unknowns).shown - plain) / size)
        except RanAway:
            return window
        order = {law: i * limits.KNOTS for i, law in enumerate(laws)}
        forms = [e.size * columns[order[e.law] + e.knot] for e in self.errors if e.law]
        return replace(window, forms=np.stack(forms, axis=2)) if forms else window

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
            # Errors of inputs are unknowns as well, but nobody asks for them.
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

    def with_input_errors(self, window: Window, unknowns: Array) -> Window:
        """A window with what the moments of its jumps and the noise of its inputs do to its
        outputs, each by its standard deviation, at some unknowns."""
        try:
            plain = self.run(self.balances, window, unknowns).shown
            moved = []
            for more in input_errors(window):
                changed = replace(window, inputs=window.inputs + more)
                moved.append(self.run(self.balances, changed, unknowns).shown - plain)
        except RanAway:
            return window
        told = [m for m in moved if (np.abs(m) > limits.SLIGHT_ERROR * self.spread).any()]
        return replace(window, jumps=np.stack(told, axis=2) if told else None)

    def fit(
        self, window: Window, prior: ErrorEstimate, guess: Array, faults: Sequence[str] = ()
    ) -> Fitted | None:
        """The most probable unknowns, from a guess; degrees stay in their range. None if nothing
        can be simulated.

        Far from the readings, these count less: else what is known of the plant counts nothing, and
        the fit ends where no plant is.
        """
        found = self.at(window, prior, guess, faults)
        if found is None:
            return None
        count = max(int(np.isfinite(window.measured).sum()), 1)
        far, left = math.sqrt(found.chi / count), 0.0
        while far > limits.FAR_OFF and left < limits.NO_CLOSER:
            model = replace(self, spread=far * self.spread)
            found = (
                model._led(window, prior, found.unknowns, faults, *limits.STEPS_FAR_OFF) or found
            )
            left = math.sqrt(found.chi / count)
            far *= min(1.0 / limits.FAR_OFF, left)
        steps = limits.WINDOW_STEPS if far <= limits.FAR_OFF else limits.STEPS_FAR_OFF
        return self._led(window, prior, found.unknowns, faults, *steps)

    def _led(
        self,
        window: Window,
        prior: ErrorEstimate,
        guess: Array,
        faults: Sequence[str],
        steps: int,
        slight: float,
    ) -> Fitted | None:
        """Where so many steps at most lead from a guess; one that lowers chi-square by a `slight`
        share is the last."""
        specs = [self.ruleset.fault_by_id[fault] for fault in faults]
        free = np.full(len(guess) - len(specs), np.inf)
        damping, more = limits.FIRST_DAMPING, limits.MORE_DAMPING
        low = np.append(-free, [spec.lowest for spec in specs])
        high = np.append(free, [s.highest * (1.0 - common.BELOW_HIGHEST) for s in specs])
        best = self.at(window, prior, guess, faults)
        for _ in range(steps):
            if best is None or damping > limits.LARGEST_DAMPING:
                break
            ended = (best.unknowns <= low) & (best.pull < 0) | (best.unknowns >= high) & (
                best.pull > 0
            )
            step, own = np.zeros(len(guess)), best.information[np.ix_(~ended, ~ended)]
            step[~ended] = inverse(own + damping * np.diag(np.diag(own))) @ best.pull[~ended]
            trial = self.at(window, prior, np.clip(best.unknowns + step, low, high), faults)
            if trial is None or not trial.chi < best.chi:
                damping *= more
                more *= limits.MORE_DAMPING
                continue
            moved = trial.unknowns - best.unknowns
            expected = float(2.0 * best.pull @ moved - moved @ best.information @ moved)
            fall, best, more = best.chi - trial.chi, trial, limits.MORE_DAMPING
            as_expected = fall / max(expected, fall)
            damping *= max(limits.LESS_DAMPING, 1.0 - (2.0 * as_expected - 1.0) ** 3)
            if fall < max(limits.WINDOW_SETTLED, slight * best.chi):
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
                errors.append(LastingError(error, -1, 0.0, size, drifts=True))
    for i, name in enumerate(dynamics.outputs):
        size = float(systematic_u(signals[name], level[i]))
        errors.append(LastingError("", i, 0.0, size, drifts=True))
    for law, share in dynamics.forms.items():
        for i, new in itertools.product(range(limits.KNOTS), (False, True)):
            size = share * (limits.NEW_FORM if new else 1.0 - limits.NEW_FORM) ** 0.5
            errors.append(LastingError("", -1, 0.0, size, law=law, knot=i, new=new))
    kept = tuple(e for e in errors if e.size > 0.0)
    return Model(ruleset, kept, spread, balances, dict.fromkeys(dynamics.forms, (0.0, 0.0)))


def inverse(information: Array) -> Array:
    """Inverse of a symmetric positive matrix with entries of very different scales."""
    diagonal = np.diag(information)
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = information / np.outer(size, size) + limits.LEAST_CURVATURE * np.eye(len(size))
    result: Array = np.linalg.inv(scaled) / np.outer(size, size)
    return 0.5 * (result + result.T)
