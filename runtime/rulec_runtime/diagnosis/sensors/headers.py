"""Headers that do not match their columns: a wrong unit, or two swapped columns.

Such a hypothesis has no free parameter: the numbers are fixed, and reading them differently makes
all estimates agree or does not. It is reported if the readings as recorded agree nowhere, no single
fault of the plant explains them, and they agree when read differently.

Source: own derivation.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import Check
from rulec_runtime.diagnosis.sensors.conditions import SWAPPED, UNIT, Condition
from rulec_runtime.diagnosis.sensors.units import Mixup, like_a_reading, mixups, of_one_dimension
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.recordings.columns import means_between, median_of
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import noise_of


@dataclass(frozen=True, kw_only=True)
class Misread:
    """Columns read differently, by `mendings`; `mended` says so in words.

    `values` are the means of stretches, shape (n,), SI, `recorded` those by the header, `noise`
    that of samples. `texts` say per signal what is wrong with it.
    """

    condition: Condition
    signals: tuple[str, ...]
    mendings: tuple[Mending, ...]
    values: Mapping[str, Array]
    recorded: Mapping[str, Array]
    noise: Mapping[str, float]
    texts: tuple[str, ...]
    mended: str


def misread_columns(raw: Recording, check: Check, still: Set[str]) -> Misread | None:
    """The one misreading that explains a recording, if there is one.

    `check` holds the readings without impossible ones, `raw` all of them; signals at `still` have
    no variation that could fit.
    """
    if check.stretches.lengths.sum() < limits.FEWEST_FOR_HEADERS or not _doubtful(check):
        return None
    best, least = None, (0, np.inf)
    for misread in _candidates(raw, check, still):
        points = check.with_readings(misread.values, misread.noise)
        left = _Otherwise(check, misread, points).left()
        # One cause for many columns comes before one column of them.
        if left is not None and (-len(misread.mendings), left) < least:
            best, least = misread, (-len(misread.mendings), left)
    return best


def _doubtful(check: Check) -> bool:
    """Whether most of a recording disagrees, or cannot be compared."""
    recorded = check.recorded
    there = check.points.values.keys()
    usable = np.array([set(o.signals) <= there for o in check.ruleset.observers], dtype=bool)
    most = recorded.freedom.max(initial=len(residual_basis(check.ruleset, usable)))
    whole = recorded.sound & (recorded.freedom == most)
    return bool(whole.mean() <= limits.AGREES_AS_RECORDED)


@dataclass(frozen=True)
class _Otherwise:
    """The readings with some columns read differently, beside those as recorded."""

    check: Check
    misread: Misread
    points: Points

    @cached_property
    def readers(self) -> np.ndarray:
        """Flags of the observers that read some of the columns."""
        return np.asarray(np.any([self.check.readers(s) for s in self.misread.signals], axis=0))

    @cached_property
    def apart(self) -> np.ndarray:
        """Stretches in which the other reading differs from the record, shape (n,)."""
        own = self.misread
        with np.errstate(invalid="ignore"):
            off = [
                np.abs(own.values[n] - own.recorded[n]) > limits.READS_OTHERWISE * self.points.u[n]
                for n in own.signals
            ]
        return np.asarray(np.any(off, axis=0))

    @cached_property
    def judged(self) -> np.ndarray:
        """Stretches, shape (n,), in which estimates that read the columns can be compared."""
        before = self.check.recorded
        return np.asarray(before.valid[self.readers].any(axis=0) & (before.freedom > 1))

    def left(self) -> float | None:
        """Chi-square over its limit that is left at a typical operating point; None if the columns
        may as well be as recorded, or the estimates do not agree this way either."""
        check, before, readers = self.check, self.check.recorded, self.readers
        sound = before.sound & before.valid[readers].all(axis=0)
        if not self.apart.any() or sound[self.apart].mean() > limits.AGREES_AS_RECORDED:
            return None
        # What does not read these columns must agree as it is: most other ways need not be tried.
        least = check.least(readers)
        if not np.any(self.apart & (least <= check.widest_limit)) or self._rivalled(least):
            return None
        found = check.agreement(self.points)
        running = found.valid[readers].any(axis=0) & (found.freedom > 0) & self.apart
        usable = before.valid[readers].sum(axis=0) >= found.valid[readers].sum(axis=0)
        agreed = before.sound & usable & (before.freedom >= found.freedom)
        if (
            not running.any()
            or agreed[running].mean() > limits.AGREES_AS_RECORDED
            or found.sound[running].mean() < limits.AGREES_OTHERWISE
            or (found.freedom >= before.freedom)[running].mean() < common.NEARLY_ALL
        ):
            return None
        # Nearly all of some stretches agree, or one and the same fault explains the rest.
        after, chi = check.explained(found), found.excess * found.limit
        quiet = after.judged & ~after.deviating
        each = quiet | ((after.probability > 0.0) & (after.freedom > 1))
        each = each[[not self._in_doubt(fault) for fault in check.ruleset.faults]]
        best = each[np.argmax(each.sum(axis=1))] if len(each) else quiet
        best = best if best[running].sum() > quiet[running].sum() else quiet
        if best[running].mean() < common.NEARLY_ALL or self._rivalled(chi, running):
            return None
        if best is quiet and not check.agrees_as_a_whole(found, running):
            return None
        if self.misread.condition is SWAPPED and self.judged.mean() >= common.NEARLY_ALL:
            # Swapped columns are rare: the swap must remove what one fault would leave.
            one = np.where(before.sound, before.excess * before.limit, np.inf)
            as_recorded = check.explained_as_recorded.distance
            one = np.fmin(one, np.min(as_recorded, axis=0, initial=np.inf))
            rest = np.fmin(chi, np.min(after.distance, axis=0, initial=np.inf))
            if np.median((one - rest)[self.judged]) <= limits.SWAP_GAIN:
                return None
        return float(np.median(found.excess[running]))

    def _rivalled(self, left: Array, running: np.ndarray | None = None) -> bool:
        """Whether a fault explains everything, as well as a hypothesis that leaves a chi-square of
        at least `left`, shape (n,); of constant degree, as one that varies between operating points
        is no fault.

        Nearly all must be judged as recorded: of what is `running` in the other reading, if that is
        known. What stands still is judged in neither.
        """
        asked = self.judged if running is None else self.judged[running]
        if asked.mean() < common.NEARLY_ALL:
            return False
        before, explained = self.check.recorded, self.check.explained_as_recorded
        for i, fault in enumerate(self.check.ruleset.faults):
            fits = explained.probability[i] > 0.0
            off = self.judged & fits & ~before.sound
            if self._in_doubt(fault) or not off.any():
                continue
            degree, u = explained.degree[i, off], float(np.median(explained.u[i, off]))
            steady = degree.std() <= common.SAME_DEGREE * abs(degree.mean()) + u
            with np.errstate(invalid="ignore"):
                more = np.where(np.isfinite(left), explained.distance[i] - left, -np.inf)
            as_well = np.median(more[off]) < limits.HEADER_ODDS
            covers = (fits | before.sound)[self.judged].mean() >= common.NEARLY_ALL
            if steady and as_well and covers:
                return True
        return False

    def _in_doubt(self, fault: FaultSpec) -> bool:
        """Whether it is an error of a reading whose unit is in doubt.

        As recorded its size would have to be the ratio of two units; in another unit the column is
        taken to be right.
        """
        own = fault.in_sensor and not set(fault.scales).isdisjoint(self.misread.signals)
        return own and self.misread.condition is UNIT


def _candidates(raw: Recording, check: Check, still: Set[str]) -> Iterator[Misread]:
    """Other readings of columns that look like readings: one in another unit, all of a dimension in
    one that their headers do not state, two exchanged."""
    ruleset, values, noise = check.ruleset, {}, {}
    for name, column in raw.values.items():
        # The means of all readings, even of impossible ones.
        if np.isfinite(column).any():
            values[name] = means_between(column, check.stretches.first, check.stretches.last)[0]
            noise[name] = noise_of(column)
    recorded = {name for name in noise if np.isfinite(values[name]).any()}
    used = [s for s in ruleset.signals if s.id in (ruleset.observed & recorded) - still]
    columns_of = Counter(column.signal for column in ruleset.columns)
    for group in of_one_dimension(used, ruleset.units):
        by_unit: dict[str, dict[str, Mixup]] = {}
        for signal in group:
            if signal.id not in raw.scales and columns_of[signal.id] > 1:
                continue  # a difference of two columns has no header of its own
            scale = raw.scales.get(signal.id, (signal.factor, signal.offset))
            for mixup in mixups(signal, scale, ruleset.units):
                by_unit.setdefault(mixup.true, {})[signal.id] = mixup
        for found in by_unit.values():
            each = [{name: mixup} for name, mixup in found.items()]
            some = (
                _in_unit(ruleset, values, noise, m)
                for m in (each if len(each) == 1 else [*each, found])
            )
            yield from (one for one in some if one is not None)
        for one, other in combinations((signal.id for signal in group), 2):
            text = f"{one} and {other} are swapped: each shows the other's values"
            yield Misread(
                condition=SWAPPED,
                signals=(one, other),
                values={one: values[other], other: values[one]},
                recorded={one: values[one], other: values[other]},
                noise={one: noise[other], other: noise[one]},
                mendings=(Mending(signals=(one, other)),),
                texts=(text, text),
                mended=f"{one} and {other} exchanged",
            )


def _from_calibrated(signal: SignalSpec, values: Array) -> float:
    """How far the usual reading is outside of the calibrated range, SI; 0 without one."""
    if signal.valid_from is None or signal.valid_to is None:
        return 0.0
    usual = median_of(values)
    return max(signal.valid_from - usual, usual - signal.valid_to, 0.0)


def _in_unit(
    ruleset: Ruleset,
    recorded: Mapping[str, Array],
    noisy: Mapping[str, float],
    found: Mapping[str, Mixup],
) -> Misread | None:
    """Columns in one other unit; None if one of them would not look like a reading in it, or would
    be farther from the readings of the calibration."""
    values, noise, texts, mendings = {}, {}, [], []
    for name, mixup in found.items():
        values[name] = recorded[name] * mixup.factor + mixup.offset
        noise[name] = noisy[name] * mixup.factor
        signal = ruleset.signal_by_id[name]
        if not like_a_reading(signal, values[name], noise[name]):
            return None
        if _from_calibrated(signal, values[name]) > _from_calibrated(signal, recorded[name]):
            return None
        by = f"by a factor of {mixup.factor:.4g}" if not mixup.offset else "by their zero"
        texts.append(
            f"{name} is not in {mixup.written}: its numbers fit the other readings as "
            f"{mixup.true} ({by})"
        )
        mendings.append(Mending(signals=(name,), factor=mixup.factor, offset=mixup.offset))
    return Misread(
        condition=UNIT,
        signals=(*found,),
        mendings=tuple(mendings),
        values=values,
        recorded={name: recorded[name] for name in found},
        noise=noise,
        texts=tuple(texts),
        mended=f"{', '.join(found)} in {next(iter(found.values())).true}",
    )
