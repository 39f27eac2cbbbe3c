"""Judge windows one after the other: without a fault, then with each of them.

Windows without a contradiction narrow the lasting errors, and later ones are judged with these, as
settled stretches are with a baseline. A window overlaps with half of the one before; only every
second one is learned from, as no sample may count twice.

The model of a real plant is off by more than noise, and equally for many samples. The recording
itself shows how far: the error that a window without a fault usually leaves, and its correlation
time, set the weight of each reading, so that only an unusual misfit counts.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import NormalDist

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.steady.isolate import alarm_chance, quantile
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.free_balances import nominal_starts
from rulec_runtime.diagnosis.stores.window_fit import ErrorEstimate, Fitted, Model, model_of
from rulec_runtime.diagnosis.stores.windows import Window, Windows
from rulec_runtime.recordings.robust_statistics import autocorrelation_time


@dataclass(frozen=True)
class Tested:
    """A fault in a window: degree and its standard uncertainty, chi-square left, and whether it
    fits.

    `fitted` is where the fit of the next window starts.
    """

    degree: float
    u: float
    chi: float
    fits: bool
    fitted: Fitted | None = None


@dataclass(frozen=True)
class Judged:
    """A window, the estimate of the errors before it, and the result.

    `freedom` is the number of independent values in its readings; `leaning`, squared, how far it
    leans towards any fault over how far windows without one usually do; `floor` the standard
    uncertainty of the degree of each fault near 0 (absent: the window cannot show it); `tests`
    exist if it is `deviating`. Without `plain` nothing could be simulated; `window.because` may say
    why.
    """

    window: Window
    prior: ErrorEstimate
    plain: Fitted | None = None
    freedom: int = 0
    deviating: bool = False
    leaning: float = 0.0
    floor: Mapping[str, float] = field(default_factory=dict)
    tests: Mapping[str, Tested] = field(default_factory=dict)

    @property
    def chi(self) -> float:
        """Chi-square without a fault; 0 if nothing could be simulated."""
        return 0.0 if self.plain is None else self.plain.chi

    def chi_beside(self, fault: str) -> float:
        """The same with a fault, if it was tried."""
        return self.tests[fault].chi if fault in self.tests else self.chi

    @property
    def fitting(self) -> set[str]:
        """Faults that fit."""
        return {name for name, test in self.tests.items() if test.fits}

    def lacks(self, fault: str) -> bool:
        """Whether it would show a fault, and does not."""
        return fault in self.floor and fault not in self.fitting


@dataclass(frozen=True)
class Judge:
    """The model, the number of independent samples per sample (per output), and the faults."""

    model: Model
    share: Array
    faults: tuple[str, ...]

    def judge(self, windows: Sequence[Window], learning: bool = True) -> list[Judged]:
        """Judge all windows in order of time; without `learning` each with the prior only."""
        errors, states = self.model.errors, self.model.states
        estimate = ErrorEstimate(np.zeros(len(errors)), np.eye(len(errors)))
        chance = alarm_chance(len(windows))
        result: list[Judged] = []
        learned = -np.inf
        for window in windows:
            prior = estimate.later(window.middle, errors)
            before = result[-1] if result and result[-1].window.piece == window.piece else None
            judged = self._judged(Judged(window, prior), before, chance)
            result.append(judged)
            plain = judged.plain
            if not learning or window.time[0] <= learned or plain is None or judged.deviating:
                continue
            if plain.chi < chi_square_limit(judged.freedom, common.CALM):
                covariance = plain.covariance[states:, states:]
                mean = plain.unknowns[states:]
                estimate = ErrorEstimate(mean, covariance, window.middle, prior.windows + 1)
                learned = float(window.time[-1])
        return result

    def _judged(self, one: Judged, before: Judged | None, chance: float) -> Judged:
        """Judge a window; its fit starts from the state of the one before at that time."""
        if one.window.because:
            return one
        starts = [] if before is None else _left_at(before, before.plain, one.window)
        starts = [*starts, nominal_starts(self.model.dynamics)]
        counts = np.isfinite(one.window.measured).sum(axis=0)
        freedom = max(int(float(counts @ self.share) - self.model.states), 1)
        errors = [one.prior.mean]
        if before is not None and before.plain is not None:
            errors.append(before.plain.unknowns[self.model.states :])
        guesses = [np.append(start, own) for own in errors for start in starts]
        enough = chi_square_limit(freedom, quantile(chance))
        plain = self._best(one, guesses, enough)
        if plain is None:
            return one
        if one.window.forms is not None:
            one = replace(one, window=self.model.with_forms(one.window, plain.unknowns))
            plain = self._best(one, [plain.unknowns], enough)
            assert plain is not None, "the same course as before"
        pull, information, _ = self._directions(one, plain)
        visible = np.flatnonzero(information > 0.0).tolist()
        floor = {self.faults[i]: float(1.0 / np.sqrt(information[i])) for i in visible}
        # Half of the chance of a false alarm goes to "anything is wrong", half to the faults.
        strongest = quantile(chance / (2 * max(len(visible), 1)))
        scores = pull[visible] / np.sqrt(information[visible])
        deviating = plain.chi > chi_square_limit(freedom, quantile(chance / 2))
        deviating |= bool((scores > strongest).any())
        by_chance = (1.0 + limits.USUAL_MISFIT ** (1.0 / max(len(visible), 1))) / 2.0
        most = float(np.abs(scores).max(initial=0.0)) / NormalDist().inv_cdf(by_chance)
        one = replace(one, plain=plain, freedom=freedom, leaning=most**2, floor=floor)
        one = replace(one, deviating=deviating)
        towards = [i for i in visible if deviating and pull[i] > 0.0]
        limit = chi_square_limit(max(freedom - 1, 1), quantile(chance))
        tests = {
            self.faults[i]: self._test(one, before, self.faults[i], pull[i] / information[i], limit)
            for i in towards
        }
        return replace(one, tests=tests)

    def _best(
        self, one: Judged, guesses: Sequence[Array], limit: float, faults: tuple[str, ...] = ()
    ) -> Fitted | None:
        """The best fit, with some degrees free; guesses are tried until one is good enough."""
        best: Fitted | None = None
        for guess in guesses:
            found = self.model.fit(one.window, one.prior, guess, faults)
            if found is not None and (best is None or found.chi < best.chi):
                best = found
            if best is not None and best.chi < limit:
                break
        return best

    def _directions(self, one: Judged, plain: Fitted) -> tuple[Array, Array, Array]:
        """Gradient by each degree at 0, the information on it with all errors free, and by how much
        each unknown falls with each degree."""
        count = len(plain.unknowns)
        unknowns = np.append(plain.unknowns, np.zeros(len(self.faults)))
        every = self.model.at(one.window, one.prior, unknowns, self.faults)
        assert every is not None, "the same course as without faults"
        shared = every.information[:count, count:]
        explained, whole = plain.covariance @ shared, np.diag(every.information)[count:]
        information = whole - np.sum(shared * explained, axis=0)
        pull = every.pull[count:] - explained.T @ every.pull[:count]
        seen = information > limits.UNDETECTABLE_EFFECT * whole
        return pull, np.where(seen, information, 0.0), explained

    def lasting(self, alone: Sequence[Judged]) -> tuple[str, Sequence[Array]]:
        """The fault that explains most of what windows judged alone leave, with one degree in all
        of them, and what it leaves of each output; no fault if none explains anything."""
        there = [(one, one.plain) for one in alone if one.plain is not None]
        if not there or not self.faults:
            return "", ()
        each = [self._directions(one, plain) for one, plain in there]
        pull, information = (np.sum([own[i] for own in each], axis=0) for i in (0, 1))
        gain = np.where(pull > 0.0, pull**2 / np.where(information > 0.0, information, np.inf), 0.0)
        best = int(np.argmax(gain))
        if not gain[best] > 0.0:
            return "", ()
        fault, degree = self.faults[best], pull[best] / information[best]
        left = []
        for (one, plain), (_, _, falls) in zip(there, each, strict=True):
            unknowns = np.append(plain.unknowns - falls[:, best] * degree, degree)
            found = self.model.at(one.window, one.prior, unknowns, (fault,))
            left.append(plain.error if found is None else found.error)
        return fault, left

    def _test(
        self, one: Judged, before: Judged | None, name: str, degree: float, limit: float
    ) -> Tested:
        """Fit a fault: from where it fitted the window before, then from the fit without it, with
        the degree by its slopes."""
        fault, plain, mean = self.model.ruleset.fault_by_id[name], one.plain, one.prior.mean
        assert plain is not None
        size = [np.clip(degree, limits.SMALLEST_START, limits.LARGEST_START * fault.highest)]
        starts, errors = np.split(plain.unknowns, [self.model.states])
        guesses = [np.concatenate([starts, own, size]) for own in (mean, errors)]
        last = before.tests[name].fitted if before and name in before.tests else None
        if before is not None and last is not None:
            left = _left_at(before, last, one.window)
            guesses[:0] = [np.concatenate([own, mean, last.unknowns[-1:]]) for own in left]
        found = self._best(one, guesses, limit, (name,))
        if found is None or found.chi > plain.chi:
            return Tested(0.0, np.inf, plain.chi, False)
        u, degree = float(np.sqrt(found.covariance[-1, -1])), float(found.unknowns[-1])
        # A real fault never follows its law exactly.
        tolerated = fault.tolerance**2 * (plain.chi - found.chi)
        fits = found.chi <= limit + tolerated and degree < fault.credible
        fits = fits and self._is_possible(one.window, found, fault)
        return Tested(degree, u, found.chi, fits, found)

    def _is_possible(self, window: Window, found: Fitted, fault: FaultSpec) -> bool:
        """Whether the true value of a faulty sensor is within its range.

        Else a wrong level could compensate any error of the balances.
        """
        outputs = self.model.dynamics.outputs
        own = [i for i, name in enumerate(outputs) if name in fault.scales]
        if not own:
            return True
        shown, _, _ = self.model.simulate(window, found.unknowns[:-1])
        ends = [self.model.ruleset.signal_by_id[outputs[i]].ends for i in own]
        levels = np.median(shown[:, own], axis=0).tolist()
        return all(low <= x <= high for x, (low, high) in zip(levels, ends, strict=True))


def _left_at(before: Judged, fitted: Fitted | None, window: Window) -> Sequence[Array]:
    """States of a fit of the window before, when this window begins, if known."""
    at = int(np.searchsorted(before.window.time, window.time[0]))
    return [] if fitted is None else [*fitted.states[at : at + 1]]


@dataclass(frozen=True)
class Weighed:
    """All windows of a recording judged, and the usual misfit of each output, SI, shape
    (outputs,)."""

    windows: Windows
    judge: Judge
    judged: Sequence[Judged]
    misfit: Array

    @property
    def model(self) -> Model:
        """The balances, each reading with its weight."""
        return self.judge.model


def weighed(ruleset: Ruleset, windows: Windows) -> Weighed:
    """Find the usual misfit, and judge all windows with it.

    What one fault with one degree in all windows explains is no misfit of the balances.
    """
    model = model_of(ruleset, windows.noise, windows.level)
    known = Judge(model, np.ones(len(windows.noise)), model.dynamics.faults)
    single = replace(known, faults=())
    alone = single.judge(windows.members, learning=False)
    model = with_spans(model, alone)
    known, single = replace(known, model=model), replace(single, model=model)
    members = tuple(
        j.window if j.plain is None else model.with_errors(j.window, j.plain.unknowns)
        for j in alone
    )
    alone = single.judge(members, learning=False)
    misfit, correlation = _left([j.plain.error for j in alone if j.plain], windows.noise)
    lasting, errors = known.lasting(alone)
    beside = _left(errors, windows.noise)
    if lasting and (beside[0] * limits.BEHIND_A_MISFIT < misfit).any():
        misfit, correlation = np.minimum(misfit, beside[0]), beside[1]
    else:
        lasting = ""
    left = limits.LARGEST_MISFIT**2
    for last in range(limits.MISFIT_PASSES + 1):
        weights = replace(model, spread=misfit * np.sqrt(correlation))
        judge = Judge(weights, 1.0 / correlation, model.dynamics.faults)
        judged = judge.judge(members)
        ratios = [j.chi_beside(lasting) / j.freedom for j in judged if j.plain is not None]
        more = min(float(np.quantile(ratios, limits.USUAL_MISFIT)) if ratios else 0.0, left)
        if more < limits.MISFIT_TOO_SMALL or last == limits.MISFIT_PASSES:
            break
        left /= more
        misfit = misfit * np.sqrt(more)
    there = [j for j in judged if j.plain is not None]
    wider = _unevenness(there, lasting)
    if there and not lasting:
        wider *= max(float(np.quantile([j.leaning for j in there], limits.USUAL_MISFIT)), 1.0)
    if wider > limits.MISFIT_TOO_SMALL:
        judge = replace(judge, model=replace(weights, spread=weights.spread * np.sqrt(wider)))
        judged = judge.judge(members)
    return Weighed(windows, judge, judged, misfit)


def _unevenness(judged: Sequence[Judged], lasting: str) -> float:
    """Factor on the usual misfit, as a variance, that one window in twenty exceeds.

    Balances that are off are off by much in some states and by little in others. How uneven that is
    is told by the windows up to the usual one, as a fault may be in the others.
    """
    there = [j for j in judged if j.chi_beside(lasting) > 0.0]
    if not there:
        return 1.0
    logs = [np.log(j.chi_beside(lasting) / j.freedom) for j in there]
    low, usual = np.quantile(logs, [limits.LOW_MISFIT, limits.USUAL_MISFIT])
    normal = NormalDist()
    apart = normal.inv_cdf(limits.USUAL_MISFIT) - normal.inv_cdf(limits.LOW_MISFIT)
    by_chance = float(np.mean([2.0 / j.freedom for j in there]))
    variance = max(float((usual - low) / apart) ** 2 - by_chance, 0.0)
    return math.exp(normal.inv_cdf(limits.ONE_IN_TWENTY) * math.sqrt(variance))


def with_spans(model: Model, judged: Sequence[Judged]) -> Model:
    """A model that knows the least and largest value of each law in all windows."""
    found = [model.laws_of(j.window, j.plain.unknowns) for j in judged if j.plain is not None]
    spans = {
        law: (min(own[law].min() for own in found), max(own[law].max() for own in found))
        for law in (model.spans if found else ())
    }
    return replace(model, spans=spans)


def _left(errors: Sequence[Array], noise: Array) -> tuple[Array, Array]:
    """Robust standard deviation and correlation time of the residuals of each output."""
    misfit, correlation = noise.copy(), np.ones(len(noise))
    for i in range(len(noise)):
        own = [(e[:, i], np.isfinite(e[:, i])) for e in errors if np.isfinite(e[:, i]).any()]
        if own:
            spreads = [float(np.sqrt(np.mean(e[finite] ** 2))) for e, finite in own]
            misfit[i] = max(float(np.quantile(spreads, limits.USUAL_MISFIT)), noise[i])
            times = [autocorrelation_time(e, finite) for e, finite in own]
            found = float(np.quantile(times, limits.USUAL_MISFIT))
            correlation[i] = found if found > limits.SLOW_ERROR else 1.0
    return misfit, correlation
