"""Headers that do not match their columns: a wrong unit, or two swapped columns.

Such a hypothesis has no free parameter: the numbers are fixed, and reading them differently makes
all estimates agree or does not. It is reported if the readings as recorded agree nowhere, no single
fault of the plant explains them, and they agree when read differently.

Source: own derivation.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import Agreement, Bench
from rulec_runtime.diagnosis.sensors.conditions import SWAPPED, UNIT, Condition
from rulec_runtime.diagnosis.sensors.units import (
    Mixup,
    exchangeable,
    like_a_reading,
    mixups,
    of_one_dimension,
)
from rulec_runtime.diagnosis.steady.isolate import Isolation
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.recordings.columns import means_between
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


def misread_columns(raw: Recording, bench: Bench, still: Set[str]) -> Misread | None:
    """The one misreading that explains a recording, if there is one.

    `bench` holds the readings without impossible ones, `raw` all of them; signals at `still` have
    no variation that could fit.
    """
    if bench.samples < limits.FEWEST_FOR_HEADERS or not _doubtful(bench):
        return None
    plain = _with_all(raw, bench)
    best, least = None, (0, np.inf)
    for misread in _candidates(raw, bench, plain, still):
        points = bench.with_readings(misread.values, misread.noise)
        if not _may_agree(bench, misread, points):
            continue
        found = bench.agreement(points)
        running = _running(bench, misread, found)
        if not _makes_sense(bench, misread, found, running):
            continue
        explained = bench.explained(found)
        if not _explains(explained, running) or not _beats_faults(bench, misread, found, explained):
            continue
        # One cause for many columns comes before one column of them.
        left = -len(misread.mendings), float(np.median(found.excess[running]))
        if left < least:
            best, least = misread, left
    return best


def _with_all(raw: Recording, bench: Bench) -> Bench:
    """The same stretches with the means of all readings, even of impossible ones."""
    values, noise = {}, {}
    first, last = bench.stretches.first, bench.stretches.last
    for name, column in raw.values.items():
        if np.isfinite(column).any():
            values[name] = means_between(column, first, last)[0]
            noise[name] = noise_of(column)
    return replace(bench, points=bench.with_readings(values, noise), noise=noise)


def _doubtful(bench: Bench) -> bool:
    """Whether most of a recording disagrees, or cannot be compared."""
    recorded = bench.recorded
    there = bench.points.values.keys()
    usable = np.array([set(o.signals) <= there for o in bench.ruleset.observers], dtype=bool)
    most = recorded.freedom.max(initial=len(residual_basis(bench.ruleset, usable)))
    whole = recorded.sound & (recorded.freedom == most)
    return bool(whole.mean() <= limits.AGREES_AS_RECORDED)


def _may_agree(bench: Bench, misread: Misread, points: Points) -> bool:
    """Whether it differs from the record, where what reads it disagrees or is missing, estimates
    that read nothing of it agree there, and no fault explains as much."""
    apart, readers, before = _apart(misread, points), _readers(bench, misread), bench.recorded
    sound = before.sound & before.valid[readers].all(axis=0)
    if not apart.any() or sound[apart].mean() > limits.AGREES_AS_RECORDED:
        return False
    least = bench.least(readers)
    agree = apart & (least <= bench.widest_limit)
    return bool(agree.any()) and not _rivalled(bench, misread, least)


def _makes_sense(bench: Bench, misread: Misread, found: Agreement, running: np.ndarray) -> bool:
    if not running.any():
        return False
    before = bench.recorded
    readers = _readers(bench, misread)
    usable = before.valid[readers].sum(axis=0) >= found.valid[readers].sum(axis=0)
    agreed = before.sound & usable & (before.freedom >= found.freedom)
    return bool(
        agreed[running].mean() <= limits.AGREES_AS_RECORDED
        and found.sound[running].mean() >= limits.AGREES_OTHERWISE
        and (found.freedom >= before.freedom)[running].mean() >= common.NEARLY_ALL
    )


def _explains(explained: Isolation, running: np.ndarray) -> bool:
    """Whether nearly all of some stretches agree, or one and the same fault explains the rest."""
    quiet = explained.judged & ~explained.deviating
    each = quiet | ((explained.probability > 0.0) & (explained.freedom > 1))
    best = each[np.argmax(each.sum(axis=1))] if len(each) else quiet
    return bool(best[running].mean() >= common.NEARLY_ALL)


def _steady(explained: Isolation, fault: int, here: np.ndarray) -> bool:
    """Whether a fault has one degree: one that varies between operating points is no fault."""
    degree, u = explained.degree[fault, here], explained.u[fault, here]
    return bool(degree.std() <= common.SAME_DEGREE * abs(degree.mean()) + float(np.median(u)))


def _readers(bench: Bench, misread: Misread) -> np.ndarray:
    return np.asarray(np.any([bench.readers(s) for s in misread.signals], axis=0))


def _running(bench: Bench, misread: Misread, found: Agreement) -> np.ndarray:
    flags: np.ndarray = found.valid[_readers(bench, misread)].any(axis=0) & (found.freedom > 0)
    flags &= _apart(misread, found.observed.points)
    return flags


def _apart(misread: Misread, points: Points) -> np.ndarray:
    """Stretches in which the other reading differs from the record, shape (n,)."""
    apart: np.ndarray = np.zeros(len(points), dtype=bool)
    for name in misread.signals:
        with np.errstate(invalid="ignore"):
            off = np.abs(misread.values[name] - misread.recorded[name])
            apart |= off > limits.READS_OTHERWISE * points.u[name]
    return apart


def _beats_faults(bench: Bench, misread: Misread, found: Agreement, after: Isolation) -> bool:
    """Whether no single fault of the plant explains all of it as well.

    A slope error of a reading whose unit is in doubt is no rival: it would have to equal the ratio
    of two units.
    """
    left = found.excess * found.limit
    if _rivalled(bench, misread, left):
        return False
    judged = _judged(bench, misread)
    if misread.condition is UNIT or judged.mean() < common.NEARLY_ALL:
        return True
    # Swapped columns are rare: the swap must remove what one fault would leave.
    before = bench.recorded
    least = np.where(before.sound, before.excess * before.limit, np.inf)
    least = np.fmin(least, np.min(bench.explained_as_recorded.distance, axis=0, initial=np.inf))
    rest = np.fmin(left, np.min(after.distance, axis=0, initial=np.inf))
    return bool(np.median((least - rest)[judged]) > limits.SWAP_GAIN)


def _judged(bench: Bench, misread: Misread) -> np.ndarray:
    """Stretches, shape (n,), in which estimates that read the columns can be compared."""
    before = bench.recorded
    return np.asarray(before.valid[_readers(bench, misread)].any(axis=0) & (before.freedom > 1))


def _rivalled(bench: Bench, misread: Misread, left: Array) -> bool:
    """Whether a fault of constant degree explains everything, as well as a hypothesis that leaves a
    chi-square of at least `left`, shape (n,)."""
    before, explained = bench.recorded, bench.explained_as_recorded
    judged = _judged(bench, misread)
    if judged.mean() < common.NEARLY_ALL:
        return False
    fitting = explained.probability > 0.0
    for i in np.flatnonzero(fitting.any(axis=1)).tolist():
        fault, fits = bench.ruleset.faults[i], fitting[i]
        own = fault.in_sensor and set(fault.scales) & set(misread.signals)
        off = judged & fits & ~before.sound
        if (own and misread.condition is UNIT) or not off.any():
            continue
        as_well = np.median((explained.distance[i] - left)[off]) < limits.HEADER_ODDS
        covers = (fits | before.sound)[judged].mean() >= common.NEARLY_ALL
        if covers and as_well and _steady(explained, i, off):
            return True
    return False


def _candidates(raw: Recording, bench: Bench, plain: Bench, still: Set[str]) -> Iterator[Misread]:
    """Other readings of columns that look like readings."""
    ruleset = bench.ruleset
    known = {n for n in plain.noise if np.isfinite(plain.points.values[n]).any()}
    names = (ruleset.observed & known) - still
    used = [s for s in ruleset.signals if s.id in names]
    for name in (s.id for s in used):
        in_units = (_in_unit(ruleset, plain, {name: m}) for m in _mixups(raw, ruleset, name))
        yield from (one for one in in_units if one is not None)
    yield from _all_in_other_units(raw, ruleset, plain, used)
    for one, other in ((a.id, b.id) for a, b in exchangeable(used, ruleset.units)):
        a, b = plain.points.values[one], plain.points.values[other]
        text = f"{one} and {other} are swapped: each shows the other's values"
        yield Misread(
            condition=SWAPPED,
            signals=(one, other),
            values={one: b, other: a},
            recorded={one: a, other: b},
            noise={one: plain.noise[other], other: plain.noise[one]},
            mendings=(Mending(signals=(one, other)),),
            texts=(text, text),
            mended=f"{one} and {other} exchanged",
        )


def _all_in_other_units(
    raw: Recording, ruleset: Ruleset, plain: Bench, used: Sequence[SignalSpec]
) -> Iterator[Misread]:
    """All columns of a dimension in one unit that their headers do not state."""
    for group in of_one_dimension(used, ruleset.units):
        by_unit: dict[str, dict[str, Mixup]] = {}
        for signal in group:
            for mixup in _mixups(raw, ruleset, signal.id):
                by_unit.setdefault(mixup.true, {})[signal.id] = mixup
        for mixups_of_unit in by_unit.values():
            together = _in_unit(ruleset, plain, mixups_of_unit)
            if len(mixups_of_unit) > 1 and together is not None:
                yield together


def _mixups(raw: Recording, ruleset: Ruleset, name: str) -> list[Mixup]:
    signal = ruleset.signal_by_id[name]
    scale = raw.scales.get(name, (signal.factor, signal.offset))
    return mixups(signal, scale, ruleset.units)


def _in_unit(ruleset: Ruleset, plain: Bench, found: Mapping[str, Mixup]) -> Misread | None:
    """Columns in one other unit; None if one of them would not look like a reading in it."""
    values, noise, texts, mendings = {}, {}, [], []
    for name, mixup in found.items():
        values[name] = plain.points.values[name] * mixup.factor + mixup.offset
        noise[name] = plain.noise[name] * mixup.factor
        if not like_a_reading(ruleset.signal_by_id[name], values[name], noise[name]):
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
        recorded={name: plain.points.values[name] for name in found},
        noise=noise,
        texts=tuple(texts),
        mended=f"{', '.join(found)} in {next(iter(found.values())).true}",
    )
