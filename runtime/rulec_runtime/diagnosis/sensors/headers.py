"""Headers that do not say what is below them: a wrong unit, or two columns in each other's place.

Nothing is free in such a hypothesis: the numbers stand, and another reading of them either makes
all estimates agree or it does not. It is told where the readings as recorded agree nowhere, where
no one fault of the plant explains them, and where read differently they agree.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.bench import Agreement, Bench, Explained
from rulec_runtime.diagnosis.sensors.conditions import SWAPPED, UNIT, Condition
from rulec_runtime.diagnosis.sensors.units import exchangeable, like_a_reading, mixups
from rulec_runtime.diagnosis.steady.parts import parts_of
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.recordings.piecewise import any_of
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import noise_of


@dataclass(frozen=True, kw_only=True)
class Misread:
    """Columns read differently: per signal factor and offset, or the signal to take instead."""

    condition: Condition
    signals: tuple[str, ...]
    values: Mapping[str, Array]
    recorded: Mapping[str, Array]
    noise: Mapping[str, float]
    text: str


def misread_columns(raw: Recording, bench: Bench, still: Set[str]) -> Misread | None:
    """The one misreading that explains a recording, if there is one.

    `bench` holds the readings without those that cannot be, `raw` all of them;
    what stands `still` has no course that could fit.
    """
    if bench.samples < limits.FEWEST_FOR_HEADERS or not _doubtful(bench):
        return None
    plain = _with_all(raw, bench)
    best, least = None, np.inf
    every = (one for one in _candidates(raw, bench.ruleset, plain, still) if _may_agree(bench, one))
    for misread, found in bench.agreements(every, partial(_read, bench)):
        if not _makes_sense(bench, misread, found) or not _beats_faults(bench, misread, found):
            continue
        explained = bench.explained(found).stretches
        running = _running(bench, misread, found)
        if explained[running].mean() < limits.NEARLY_ALL:
            continue
        left = float(np.median(found.excess[running]))
        if left < least:
            best, least = misread, left
    return best


def _with_all(raw: Recording, bench: Bench) -> Bench:
    """The same stretches with the means of all readings, whatever they are."""
    values, noise = {}, {}
    pieces = list(zip(bench.stretches.first, bench.stretches.last, strict=True))
    for name, column in raw.values.items():
        if any_of(column):
            values[name] = np.array([_mean(column[a:b]) for a, b in pieces])
            noise[name] = noise_of(column)
    return replace(bench, points=bench.with_readings(values, noise), noise=noise)


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan


def _doubtful(bench: Bench) -> bool:
    """Does most of a recording disagree, or not let itself be compared?"""
    recorded = bench.recorded
    most = recorded.freedom.max(initial=0)
    whole = recorded.sound & (recorded.freedom == max(most, _rank(bench)))
    return bool(whole.mean() <= limits.AGREES_AS_RECORDED)


def _rank(bench: Bench) -> int:
    """Degrees of freedom if every observer with readings could be used."""
    there = set(bench.points.values)
    usable = np.array([set(o.signals) <= there for o in bench.ruleset.observers], dtype=bool)
    return len(residual_basis(bench.ruleset, usable))


def _read(bench: Bench, misread: Misread) -> Points:
    """The readings of a bench, some columns of which are read differently."""
    return bench.with_readings(misread.values, misread.noise)


def _may_agree(bench: Bench, misread: Misread) -> bool:
    """Is it another reading that may make what disagrees agree, as far as a part of it tells?"""
    points = _read(bench, misread)
    apart = _apart(misread, points)
    if not apart.any():
        return False
    readers = _readers(bench, misread)
    apart &= bench.left_out.least(readers) <= bench.widest_limit
    parts = parts_of(bench.ruleset)
    for part in parts if len(parts) > 1 else ():
        if apart.any() and readers[part.observers].any():
            found = replace(bench, ruleset=part.ruleset).agreement(points)
            left = np.where(found.freedom > 0, found.excess * found.limit, 0.0)
            apart &= left <= bench.widest_limit
    return bool(apart.any())


def _makes_sense(bench: Bench, misread: Misread, found: Agreement) -> bool:
    """Do readings agree that disagreed everywhere before?"""
    running = _running(bench, misread, found)
    if running.sum() == 0:
        return False
    before = bench.recorded
    readers = _readers(bench, misread)
    usable = before.valid[readers].sum(axis=0) >= found.valid[readers].sum(axis=0)
    agreed = before.sound & usable & (before.freedom >= found.freedom)
    return bool(
        agreed[running].mean() <= limits.AGREES_AS_RECORDED
        and found.sound[running].mean() >= limits.AGREES_OTHERWISE
        and (found.freedom >= before.freedom)[running].mean() >= limits.NEARLY_ALL
    )


def _steady(explained: Explained, fault: int, here: np.ndarray) -> bool:
    """Has a fault one degree? What needs another one at each operating point is no fault."""
    degree, u = explained.degree[fault, here], explained.u[fault, here]
    return bool(degree.std() <= limits.SAME_DEGREE * abs(degree.mean()) + float(np.median(u)))


def _readers(bench: Bench, misread: Misread) -> np.ndarray:
    flags: np.ndarray = np.any([bench.readers(s) for s in misread.signals], axis=0)
    return flags


def _running(bench: Bench, misread: Misread, found: Agreement) -> np.ndarray:
    """Stretches in which the other reading can be held against something, and is another one."""
    flags: np.ndarray = found.valid[_readers(bench, misread)].any(axis=0) & (found.freedom > 0)
    flags &= _apart(misread, found.points)
    return flags


def _apart(misread: Misread, points: Points) -> np.ndarray:
    """Stretches in which the other reading is another one, shape (n,)."""
    apart: np.ndarray = np.zeros(len(points), dtype=bool)
    for name in misread.signals:
        with np.errstate(invalid="ignore"):
            off = np.abs(misread.values[name] - misread.recorded[name])
            apart |= off > limits.READS_OTHERWISE * points.u[name]
    return apart


def _beats_faults(bench: Bench, misread: Misread, found: Agreement) -> bool:
    """Is there no one fault of the plant that explains all of it as well?

    A slope of the very reading whose unit is in doubt is no rival: it would have to hit the ratio
    of two units.
    """
    before = bench.recorded
    readers = _readers(bench, misread)
    judged = before.valid[readers].any(axis=0) & (before.freedom > 1)
    if judged.mean() < limits.NEARLY_ALL:
        return True
    explained = bench.explained_as_recorded
    least = np.where(before.sound, before.excess * before.limit, np.inf)
    for i, fault in enumerate(bench.ruleset.faults):
        fits, distance = explained.fits[i], explained.distance[i]
        least = np.fmin(least, distance)
        own = fault.in_sensor and set(fault.scales) & set(misread.signals)
        off = judged & fits & ~before.sound
        if (own and misread.condition is UNIT) or not off.any():
            continue
        left = (found.excess * found.limit)[off]
        as_well = np.median(distance[off] - left) < limits.HEADER_ODDS
        covers = (fits | before.sound)[judged].mean() >= limits.NEARLY_ALL
        if covers and as_well and _steady(explained, i, off):
            return False
    if misread.condition is UNIT:
        return True
    # Two columns are seldom swapped: what one fault leaves must be gone by it.
    after = bench.explained(found)
    rest = np.min(after.distance, axis=0, initial=np.inf)
    rest = np.fmin(rest, found.excess * found.limit)
    return bool(np.median((least - rest)[judged]) > limits.SWAP_GAIN)


def _candidates(
    raw: Recording, ruleset: Ruleset, plain: Bench, still: Set[str]
) -> Iterator[Misread]:
    known = {n for n in plain.noise if np.isfinite(plain.points.values[n]).any()}
    names = (ruleset.observed & known) - still
    used = [s for s in ruleset.signals if s.id in names]
    yield from _other_units(raw, ruleset, plain, [s.id for s in used])
    for one, other in exchangeable(used, ruleset.units):
        a, b = plain.points.values[one.id], plain.points.values[other.id]
        text = f"{one.id} and {other.id} are swapped: each shows what the other one should"
        yield Misread(
            condition=SWAPPED,
            signals=(one.id, other.id),
            values={one.id: b, other.id: a},
            recorded={one.id: a, other.id: b},
            noise={one.id: plain.noise[other.id], other.id: plain.noise[one.id]},
            text=text,
        )


def _other_units(
    raw: Recording, ruleset: Ruleset, plain: Bench, names: list[str]
) -> Iterator[Misread]:
    for name in names:
        signal = ruleset.signal_by_id[name]
        scale = raw.scales.get(name, (signal.factor, signal.offset))
        for mixup in mixups(signal, scale, ruleset.units):
            values = plain.points.values[name] * mixup.factor + mixup.offset
            noise = plain.noise[name] * mixup.factor
            if not like_a_reading(signal, values, noise):
                continue
            by = f"by a factor of {mixup.factor:.4g}" if not mixup.offset else "by their zero"
            text = (
                f"{name} is not in {mixup.written}: its numbers fit the other readings as "
                f"{mixup.true} ({by})"
            )
            recorded = {name: plain.points.values[name]}
            yield Misread(
                condition=UNIT,
                signals=(name,),
                values={name: values},
                recorded=recorded,
                noise={name: noise},
                text=text,
            )
