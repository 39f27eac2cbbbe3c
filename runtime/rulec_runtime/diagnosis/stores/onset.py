"""Which fault began, and when: balances followed from the last sound window into a run of deviating
ones.

Behind its beginning a fault often looks like another one, as levels settle where both would hold
them. How a plant gets there tells them apart: a wrong sensor jumps, a leak is felt at once, a weak
pump only behind the tanks between.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady.causes import Other, rivals_of
from rulec_runtime.diagnosis.steady.isolate import alarm_chance, quantile, shares
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.free_balances import with_free_states
from rulec_runtime.diagnosis.stores.joined_windows import Cause
from rulec_runtime.diagnosis.stores.judge_windows import Judged, Weighed
from rulec_runtime.diagnosis.stores.window_fit import ErrorEstimate, Model, inverse
from rulec_runtime.diagnosis.stores.windows import Window
from rulec_runtime.simulation.balances import RanAway


@dataclass(frozen=True)
class Onset:
    """A fault that begins at a time and stays: its degree with its standard uncertainty, chi-square
    left, and what the freedom of its law costs in evidence, in units of chi-square."""

    fault: FaultSpec
    time: float
    degree: float
    u: float
    chi: float
    occam: float

    @property
    def explains(self) -> bool:
        """Whether its degree is not 0."""
        return self.degree > common.COVERAGE * self.u


def cause_of(found: Weighed, run: range) -> tuple[Cause, float] | None:
    """The fault that most probably begins before a run, and when; None if there is no sound window
    before it, or the most probable one does not fit."""
    judged = found.judged
    sound, upto = judged[max(run[0] - 1, 0)], judged[run[: limits.WINDOWS_IN_A_ROW][-1]]
    if sound.window.piece != upto.window.piece or sound.plain is None or sound.deviating:
        return None
    window = _joined(found, sound, upto)
    there = [one for one in _onsets(found, run, sound, window) if one.explains]
    if not there:
        return None
    # Half of each further window, as neighbours share half of their samples.
    later = [judged[i] for i in run[limits.WINDOWS_IN_A_ROW : -1]]
    left = [0.5 * sum(w.chi_beside(one.fault.id) for w in later) for one in there]
    chi = np.array([one.chi + one.occam for one in there]) + left
    odds = np.log([one.fault.odds for one in there])
    posterior, unprejudiced = (
        shares((own - 0.5 * chi)[:, None])[:, 0].tolist() for own in (odds, 0.0)
    )
    weighed = [
        Other(one.fault.id, *chances)
        for one, *chances in zip(there, posterior, unprejudiced, strict=True)
    ]
    best = int(np.argmax(posterior))
    named = there[best]
    counts = np.isfinite(window.measured).sum(axis=0)
    freedom = max(int(float(counts @ found.judge.share) - found.model.states - 1), 1)
    lacking = sum(one.lacks(named.fault.id) for one in later)
    limit = chi_square_limit(freedom, quantile(alarm_chance(len(judged))))
    if named.chi > limit or lacking > (1.0 - limits.FITS_MOST) * len(later):
        return None
    half = common.COVERAGE * named.u
    rivals, remote = rivals_of(weighed[best], weighed[:best] + weighed[best + 1 :])
    bounds = named.degree - half, named.degree + half
    cause = Cause(named.fault.id, named.degree, *bounds, posterior[best], rivals, remote)
    return cause, named.time


def _joined(found: Weighed, sound: Judged, upto: Judged) -> Window:
    assert sound.plain is not None
    window = found.windows.joined(sound.window, upto.window)
    return found.model.with_errors(window, sound.plain.unknowns)


def _onsets(found: Weighed, run: range, sound: Judged, window: Window) -> list[Onset]:
    """All faults that fit some window of a run, each at its most probable beginning."""
    faults, dynamics = found.model.ruleset.fault_by_id, found.model.dynamics
    assert sound.plain is not None
    times = range(len(sound.window.time) // 2, len(window.time))
    unknowns = np.append(sound.plain.unknowns, limits.SMALLEST_START)
    tried = []
    fitting = set[str]().union(*(found.judged[i].fitting for i in run))
    for name in (name for name in faults if name in fitting):
        model = replace(found.model, balances=with_free_states(dynamics, switched=name))
        beginning = _Beginning(faults[name], model, sound.prior, window)
        with suppress(RanAway):
            tried.append((beginning, *beginning.most(unknowns, times)))
    most = max((gain for _, _, gain in tried), default=0.0)
    begun = (
        beginning.onset(unknowns, first, times)
        for beginning, first, gain in tried
        if gain > 0.0 and gain >= limits.LEAST_GAIN * most
    )
    return [one for one in begun if one is not None]


@dataclass(frozen=True)
class _Beginning:
    """A fault that begins in a window; its degree ends the unknowns of the `model`."""

    fault: FaultSpec
    model: Model
    prior: ErrorEstimate
    window: Window

    def onset(self, unknowns: Array, first: int, times: range) -> Onset | None:
        """The fault at its most probable time, near a first sample; then with the freedom of its
        law. None if nothing can be simulated."""
        own, fitted = self, None
        try:
            for loosened in (False, False, *(limits.ROUNDS_OF_LAW * [True])):
                if loosened:
                    own = replace(self, window=self._loose(unknowns, first))
                near = range(
                    max(first - limits.NEAR, times[0]), min(first + limits.NEAR, times[-1]) + 1
                )
                at, _ = own.most(unknowns, near)
                found = own.model.fit(own._on(at), self.prior, unknowns, (self.fault.id,))
                if found is not None and (loosened or fitted is None or found.chi < fitted.chi):
                    first, fitted, unknowns = at, found, found.unknowns
        except RanAway:
            return None
        if fitted is None:
            return None
        u = float(np.sqrt(fitted.covariance[-1, -1]))
        time, degree = float(self.window.time[first]), float(fitted.unknowns[-1])
        return Onset(self.fault, time, degree, u, fitted.chi, own._occam())

    def most(self, unknowns: Array, times: Sequence[int]) -> tuple[int, float]:
        """The sample at which a beginning explains most, everything else refitted to first order,
        and by how much it lowers chi-square; raises `RanAway`."""
        model, never = self.model, self._on(len(self.window.time))
        at = model.at(never, self.prior, unknowns[:-1])
        if at is None:
            raise RanAway
        there = np.isfinite(at.error)
        weights = np.broadcast_to(1.0 / model.spread, there.shape)[there]
        table = model.simulate(never, unknowns[:-1])[1][there] * weights[:, None]
        rows, plain = at.error[there] * weights, self._shown(never, unknowns)
        jumps = self._jumps(there) * weights[:, None]
        certain = np.linalg.inv(np.eye(jumps.shape[1]) + jumps.T @ jumps)
        covariance = inverse(at.information)
        best, gain = times[0], 0.0
        for first in times:
            moved = (self._shown(self._on(first), unknowns) - plain)[there] * weights
            left = moved - jumps @ (certain @ (jumps.T @ moved))
            shared = left @ table
            pull = moved @ rows - shared @ covariance @ at.pull
            square = left @ moved - shared @ covariance @ shared
            if square > 0.0 and pull > 0.0 and pull**2 / square > gain:
                best, gain = first, float(pull**2 / square)
        return best, gain

    def _on(self, first: int, share: Array | float = 1.0) -> Window:
        """A window in which a share of the fault is present from a sample on."""
        later = (np.arange(len(self.window.time)) >= first) * share
        return replace(self.window, inputs=np.column_stack([self.window.inputs, later]))

    def _shown(self, window: Window, unknowns: Array) -> Array:
        return self.model.run(self.model.balances, window, unknowns, (self.fault.id,)).shown

    def _jumps(self, there: np.ndarray) -> Array:
        none = np.zeros((np.count_nonzero(there), 0))
        return none if self.window.jumps is None else self.window.jumps[there]

    def _loose(self, unknowns: Array, first: int) -> Window:
        """The window with what it does to the outputs that a fault never follows its law exactly:
        within its tolerance it differs every few samples."""
        plain, sample = self._shown(self._on(first), unknowns), np.arange(len(self.window.time))
        knots = np.arange(first, len(sample) + limits.SAMPLES_OF_A_LAW, limits.SAMPLES_OF_A_LAW)
        hats = (np.interp(sample, knots, hat) for hat in np.eye(len(knots)))
        more = (self._on(first, 1.0 + self.fault.tolerance * hat) for hat in hats)
        columns = np.stack([self._shown(one, unknowns) - plain for one in more], axis=2)
        # The tolerance is one of what the fault does, however its degree is defined.
        whole = columns.sum(axis=2).ravel()
        effect = (plain - self._shown(self._on(first, 0.0), unknowns)).ravel()
        columns *= self.fault.tolerance * np.sqrt(effect @ effect / (whole @ whole or np.inf))
        told = [] if self.window.jumps is None else [self.window.jumps]
        return replace(self.window, jumps=np.concatenate([*told, columns], axis=2))

    def _occam(self) -> float:
        """Twice the logarithm by which the freedom of the law widens the prediction."""
        there = np.isfinite(self.window.measured)
        columns = (
            self._jumps(there) / np.broadcast_to(self.model.spread, there.shape)[there][:, None]
        )
        return float(np.linalg.slogdet(np.eye(columns.shape[1]) + columns.T @ columns)[1])
