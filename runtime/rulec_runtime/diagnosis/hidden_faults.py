"""Faults that missing readings hide: which, since when, and what makes them detectable again.

A reading is missing where its column is missing or empty, or where its values were rejected (dead,
stuck, out of range). Gaps shorter than a finding needs do not count. Neither do modules at
standstill, with readings below their minimum: they would show nothing anyway.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.detectable_faults import visible_of
from rulec_runtime.diagnosis.steady.points import at_rest, is_bad
from rulec_runtime.recordings.columns import runs_where
from rulec_runtime.recordings.plant_calendar import ENDED, TO_THE_END
from rulec_runtime.recordings.recording import Recording

Runs = Sequence[tuple[int, int]]
"""Pairs of the first row and the row after the last."""


@dataclass(frozen=True, kw_only=True)
class Blind:
    """Faults that all readings together could show but the present ones cannot, over a period;
    times in s.

    `readings` is the smallest set that makes them detectable again, `because` why these are
    missing.
    """

    faults: tuple[str, ...]
    since: float
    until: float
    because: str
    readings: tuple[str, ...]
    behind: str | None = ENDED

    @property
    def active(self) -> bool:
        """Whether they were still undetectable at the end."""
        return self.behind is not ENDED

    def but(self, detectable: Set[str]) -> Blind:
        """The same without faults that are detectable by other means."""
        return replace(self, faults=tuple(f for f in self.faults if f not in detectable))


def blind_of(recording: Recording, ruleset: Ruleset) -> tuple[Blind, ...]:
    """Faults that the sound readings of a recording cannot show."""
    lost = {name: runs for name, runs in _lost(recording, ruleset) if runs}
    why = {name: (recording.unfit or {}).get(name, "no reading") for name in recording.values}
    still = {
        s.id: _runs(recording.values[s.id], partial(np.greater, s.minimum))
        for s in ruleset.signals
        if s.minimum is not None and s.id in recording.values
    }
    return blind_between(ruleset, (recording.time, recording.time), lost, still, why)


def blind_between(
    ruleset: Ruleset,
    times: tuple[Array, Array],
    lost: Mapping[str, Runs],
    still: Mapping[str, Runs],
    why: Mapping[str, str],
) -> tuple[Blind, ...]:
    """The same, given the rows in which signals are lost, and those in which they are below
    minimum.

    `times` are the first and last times of rows, s, shape (n,) each; `why` gives the reason for
    lost signals that were recorded.
    """
    if not lost:
        return ()
    (begin, end), count = times, len(times[0])
    periods: dict[tuple[int, int, tuple[str, ...]], set[str]] = {}
    for fault, first, last, readings in _blind_runs(ruleset, count, lost, still):
        periods.setdefault((first, last, readings), set()).add(fault)
    return tuple(
        Blind(
            faults=tuple(f.id for f in ruleset.faults if f.id in faults),
            since=float(begin[first]),
            until=float(end[last - 1]),
            because=_because(readings, why),
            readings=readings,
            behind=TO_THE_END if last == count else ENDED,
        )
        for (first, last, readings), faults in sorted(periods.items())
    )


def coverage_of(ruleset: Ruleset, blind: Iterable[Blind], begin: float, end: float) -> float:
    """Share of the time of all faults in which the readings could show them."""
    whole = len(ruleset.faults) * (end - begin)
    blind_time = sum(len(one.faults) * (one.until - one.since) for one in blind)
    return 1.0 - min(blind_time / whole, 1.0) if whole > 0.0 else float(not blind_time)


BlindRun = tuple[str, int, int, tuple[str, ...]]
"""An undetectable fault, its first row and the row after the last, and the readings it needs."""


def _blind_runs(
    ruleset: Ruleset, count: int, lost: Mapping[str, Runs], still: Mapping[str, Runs]
) -> Iterator[BlindRun]:
    """Runs of rows in which a fault is never detectable; lost readings hide it in the end rows."""
    visible = visible_of(ruleset)
    cache: dict[tuple[frozenset[str], frozenset[str]], dict[str, tuple[str, ...]]] = {}
    begun: dict[str, BlindRun] = {}
    for first, last, gone, low in _segments(count, lost, still):
        rests = at_rest(ruleset, low)
        if (gone, rests) not in cache:
            faults = visible.unseen(gone, rests)
            cache[gone, rests] = {f: visible.brings_back(f, gone, rests) for f in faults}
        unseen = cache[gone, rests]
        for fault, readings in unseen.items():
            before = begun.get(fault)
            if before is not None and before[3] != readings:
                yield before
                before = None
            begun[fault] = (fault, first if before is None else before[1], last, readings)
        for fault in begun.keys() - unseen.keys():
            if visible.sees(fault, gone, rests):
                yield begun.pop(fault)
            elif gone.issuperset(begun[fault][3]):  # its module stands, its readings still fail
                begun[fault] = (fault, begun[fault][1], last, begun[fault][3])
    yield from begun.values()


def _segments(
    count: int, lost: Mapping[str, Runs], still: Mapping[str, Runs]
) -> Iterator[tuple[int, int, frozenset[str], frozenset[str]]]:
    """Rows with the same lost and the same low signals: first, after last, these signals."""
    changes: dict[int, tuple[set[str], set[str]]] = {0: (set(), set()), count: (set(), set())}
    for side, table in enumerate((lost, still)):
        for name, runs in table.items():
            for edge in (edge for run in runs for edge in run):
                changes.setdefault(edge, (set(), set()))[side].add(name)
    gone, low = frozenset[str](), frozenset[str]()
    for first, last in pairwise(sorted(changes)):
        gone, low = gone ^ changes[first][0], low ^ changes[first][1]
        yield first, last, gone, low


def _because(readings: Sequence[str], why: Mapping[str, str]) -> str:
    reasons: dict[str, list[str]] = {}
    for name in readings:
        reasons.setdefault(why.get(name, "not in the recording"), []).append(name)
    return "; ".join(f"{', '.join(names)}: {reason}" for reason, names in reasons.items())


def _lost(recording: Recording, ruleset: Ruleset) -> Iterator[tuple[str, Runs]]:
    """Signals in use, with the rows without a reading. If all columns come by a map, the plant
    lacks the signals that the map omits."""
    mapped = {column.signal for column in ruleset.columns}
    by_map = mapped >= recording.values.keys()
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if signal.id not in ruleset.read:
            continue
        if values is not None:
            yield signal.id, _runs(values, partial(is_bad, signal))
        elif not (mapped and by_map) or signal.id in mapped:
            yield signal.id, ((0, len(recording)),)


def _runs(values: Array, flags: Callable[[Array], np.ndarray]) -> Runs:
    """Rows in which most neighbours are flagged, in runs as long as a finding needs."""
    beside = limits.PERSISTENCE - 1
    if len(values) < limits.PERSISTENCE:
        return ()
    width = 2 * beside + 1
    with np.errstate(invalid="ignore"):
        here = flags(values)
    # A recording is mirrored at its ends.
    count = np.concatenate([[0], np.cumsum(np.pad(here, beside, mode="reflect"))])
    return runs_where(2 * (count[width:] - count[:-width]) > width, limits.PERSISTENCE)
