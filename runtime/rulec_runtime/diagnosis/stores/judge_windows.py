"""Judge windows one after the other: without a fault, then with each of them.

Windows without a contradiction narrow the lasting errors, and later ones are judged with these, as
settled stretches are with a baseline. A window overlaps with half of the one before; only every
second one is learned from, as no sample may count twice.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady.isolate import alarm_chance, quantile
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.errors import KnownErrors, nothing_known
from rulec_runtime.diagnosis.stores.free_balances import nominal_starts
from rulec_runtime.diagnosis.stores.window_fit import Fitted, Guess, Model, inverse
from rulec_runtime.diagnosis.stores.windows import Window


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
    """A window, the errors known before it, and the result.

    `freedom` is the number of independent values in its readings; `floor` the standard uncertainty
    of the degree of each fault near 0 (absent: the window cannot show it); `tests` exist if it is
    `deviating`. Without `plain` nothing could be simulated; `window.because` may say why.
    """

    window: Window
    known: KnownErrors
    plain: Fitted | None
    freedom: int
    deviating: bool
    floor: Mapping[str, float]
    tests: Mapping[str, Tested] = field(default_factory=dict)

    def lacks(self, fault: str) -> bool:
        """Whether it would show a fault, and does not."""
        if self.plain is None or fault not in self.floor:
            return False
        return not (fault in self.tests and self.tests[fault].fits)


@dataclass(frozen=True)
class Judge:
    """The model, the number of independent samples per sample (per output), and the faults."""

    model: Model
    share: Array
    faults: tuple[str, ...]

    def judge(self, windows: Sequence[Window], learning: bool = True) -> list[Judged]:
        """Judge all windows in order of time; without `learning` each with the prior only."""
        known, guess = nothing_known(self.model.errors), nominal_starts(self.model.dynamics)
        # Constants, which have a value, do not drift.
        drifts = np.array([e.value == 0.0 for e in self.model.errors], dtype=bool)
        chance = alarm_chance(len(windows))
        result: list[Judged] = []
        learned = -np.inf
        for window in windows:
            now = known.later(window.middle, drifts) if known.windows else known
            before = result[-1] if result and result[-1].window.piece == window.piece else None
            judged = self._judged(window, now, before, guess, chance)
            result.append(judged)
            plain = judged.plain
            if not learning or window.time[0] <= learned or plain is None or judged.deviating:
                continue
            if plain.chi < chi_square_limit(judged.freedom, common.CALM):
                starts = len(plain.guess.starts)
                covariance = plain.covariance[starts:, starts:]
                known = KnownErrors(plain.guess.errors, covariance, window.middle, now.windows + 1)
                learned = float(window.time[-1])
        return result

    def _judged(
        self,
        window: Window,
        known: KnownErrors,
        before: Judged | None,
        nominal: Array,
        chance: float,
    ) -> Judged:
        """Judge a window; its fit starts from the state of the one before at that time."""
        if window.because:
            return Judged(window, known, None, 0, False, {})
        last = before.plain if before is not None else None
        starts = [*_left_at(before, last, window), nominal]
        freedom, guesses = self.freedom(window), [Guess(s, known.mean, np.zeros(0)) for s in starts]
        plain = self._fitted(window, known, guesses, chi_square_limit(freedom, quantile(chance)))
        if plain is None:
            return Judged(window, known, None, 0, False, {})
        pull, information = self._directions(window, known, plain)
        visible = np.flatnonzero(information > 0.0).tolist()
        floor = {self.faults[i]: float(1.0 / np.sqrt(information[i])) for i in visible}
        # Half of the chance of a false alarm goes to "anything is wrong", half to the faults.
        strongest = quantile(chance / (2 * max(len(visible), 1)))
        deviating = plain.chi > chi_square_limit(freedom, quantile(chance / 2))
        deviating |= any(pull[i] / np.sqrt(information[i]) > strongest for i in visible)
        if not deviating:
            return Judged(window, known, plain, freedom, False, floor)
        limit = chi_square_limit(max(freedom - 1, 1), quantile(chance))
        tests = {}
        for i in visible:
            if pull[i] > 0.0:
                fault = self.model.ruleset.fault_by_id[self.faults[i]]
                largest = limits.LARGEST_START * fault.highest
                degree = np.clip(pull[i] / information[i], limits.SMALLEST_START, largest).item()
                start = plain.guess.starts
                guesses = [
                    Guess(start, e, np.array([degree])) for e in (known.mean, plain.guess.errors)
                ]
                last = (
                    before.tests[fault.id].fitted if before and fault.id in before.tests else None
                )
                for earlier in _left_at(before, last, window):
                    assert last is not None
                    guesses.insert(0, Guess(earlier, known.mean, last.guess.degrees))
                tests[fault.id] = self._test(window, known, plain, fault, guesses, limit)
        return Judged(window, known, plain, freedom, True, floor, tests)

    def _fitted(
        self,
        window: Window,
        known: KnownErrors,
        guesses: Sequence[Guess],
        limit: float,
        faults: tuple[str, ...] = (),
    ) -> Fitted | None:
        """The best fit, with some degrees free; guesses are tried until one is good enough."""
        best: Fitted | None = None
        for guess in guesses:
            found = self.model.fit(window, known, guess, faults)
            if found is not None and (best is None or found.chi < best.chi):
                best = found
            if best is not None and best.chi < limit:
                break
        return best

    def freedom(self, window: Window) -> int:
        """Independent values in the readings of a window, less its initial states."""
        counts = np.isfinite(window.measured).sum(axis=0)
        said = float(counts @ self.share) - len(self.model.dynamics.states)
        return max(int(said), 1)

    def _directions(self, window: Window, known: KnownErrors, plain: Fitted) -> tuple[Array, Array]:
        """Gradient by each degree at 0, and the information on it with all errors free."""
        guess = Guess(plain.guess.starts, plain.guess.errors, np.zeros(len(self.faults)))
        _, slopes, _ = self.model.simulate(window, guess, self.faults)
        table = self.model.rows_of_slopes(plain.error, slopes)
        rows, count = self.model.rows(plain.error), len(plain.information)
        own, effect = table[:, :count], table[:, count:]
        known_by_errors = own.T @ effect
        gradient = own.T @ rows
        starts = len(plain.guess.starts)
        certain = inverse(known.covariance)
        gradient[starts:] -= certain @ (plain.guess.errors - known.mean)
        explained = plain.covariance @ known_by_errors
        whole = np.einsum("nf,nf->f", effect, effect)
        information = whole - np.einsum("uf,uf->f", known_by_errors, explained)
        pull = effect.T @ rows - explained.T @ gradient
        return pull, np.where(information > limits.HIDDEN_EFFECT * whole, information, 0.0)

    def _test(
        self,
        window: Window,
        known: KnownErrors,
        plain: Fitted,
        fault: FaultSpec,
        guesses: Sequence[Guess],
        limit: float,
    ) -> Tested:
        found = self._fitted(window, known, guesses, limit, (fault.id,))
        if found is None or found.chi > plain.chi:
            return Tested(0.0, np.inf, plain.chi, False)
        u = float(np.sqrt(found.covariance[-1, -1]))
        # A real fault never follows its law exactly.
        tolerated = fault.tolerance**2 * (plain.chi - found.chi)
        degree = float(found.guess.degrees[0])
        fits = found.chi <= limit + tolerated and degree < fault.credible
        fits = fits and self._is_possible(window, found, fault)
        return Tested(degree, u, found.chi, fits, found)

    def _is_possible(self, window: Window, found: Fitted, fault: FaultSpec) -> bool:
        """Whether the true value of a faulty sensor is within its range.

        Else a wrong level could compensate any error of the balances.
        """
        outputs = self.model.dynamics.outputs
        own = [i for i, name in enumerate(outputs) if name in fault.scales]
        if not own:
            return True
        shown, _, _ = self.model.simulate(window, replace(found.guess, degrees=np.zeros(0)))
        signals = self.model.ruleset.signal_by_id
        ends = [signals[outputs[i]].ends for i in own]
        levels = np.median(shown[:, own], axis=0).tolist()
        return all(low <= x <= high for x, (low, high) in zip(levels, ends, strict=True))


def _left_at(before: Judged | None, fitted: Fitted | None, window: Window) -> list[Array]:
    """States of a fit of the window before, when this window begins, if known."""
    if before is None or fitted is None:
        return []
    at = int(np.searchsorted(before.window.time, window.time[0]))
    return [fitted.states[at]] if at < len(fitted.states) else []
