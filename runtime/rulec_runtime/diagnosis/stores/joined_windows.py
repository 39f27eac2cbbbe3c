"""Neighbouring windows with the same verdict, and which fault explains them.

Neighbours share half of their samples, so a persistent fault must fit in three in a row: the first
and the last of them share none. In a recording of fewer windows it must fit in all of them.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady.isolate import shares
from rulec_runtime.diagnosis.steady.rivals import Other, rivals_of
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.judge_windows import Judged


@dataclass(frozen=True)
class Cause:
    """A fault that explains a spell, with its alternatives."""

    fault: str
    degree: float
    lower: float
    upper: float
    probability: float
    rivals: tuple[tuple[str, float], ...]
    remote: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Spell:
    """Deviating windows ``first : last`` (excluded) in a row; `cause` is None if nothing known
    fits, `brief` if it does not persist."""

    first: int
    last: int
    cause: Cause | None
    brief: bool

    @property
    def members(self) -> range:
        """Numbers of its windows."""
        return range(self.first, self.last)

    @property
    def inside(self) -> range:
        """Those between the first and the last, if there are any."""
        return _inside(self.members)


def spells_of(judged: Sequence[Judged], faults: Mapping[str, FaultSpec]) -> list[Spell]:
    """All spells of a recording; `faults` by id, in the order of the ruleset."""
    return [spell for run in _runs(judged) for spell in _explained(judged, run, faults)]


def _runs(judged: Sequence[Judged]) -> Iterator[range]:
    first: int | None = None
    for i, one in enumerate([*judged, None]):
        ends = one is None or not one.deviating
        if first is not None and (ends or one.window.piece != judged[first].window.piece):  # type: ignore[union-attr]
            yield range(first, i)
            first = None
        if not ends and first is None:
            first = i


def _explained(
    judged: Sequence[Judged], run: range, faults: Mapping[str, FaultSpec]
) -> list[Spell]:
    """One fault for all windows of a run if there is one; else one after the other. If none of them
    persists, but the deviation does, nothing known fits."""
    needed = windows_needed(judged, run[0])
    if names := _fitting(judged, run):
        return [_spell(judged, run, names, faults, needed)]
    found = []
    first = run.start
    while first < run.stop:
        last, common = first + 1, _accepted(judged[first])
        while last < run.stop:
            more = _accepted(judged[last])
            if bool(common) != bool(more) or (common and not common & more):
                break
            common &= more
            last += 1
        found.append(_spell(judged, range(first, last), common, faults, needed))
        first = last
    if len(run) >= needed and all(spell.brief for spell in found):
        return [Spell(run.start, run.stop, None, False)]
    return found


def windows_needed(judged: Sequence[Judged], place: int) -> int:
    """Number of windows in a row that a finding needs, in the piece of one of them."""
    beside = sum(one.window.piece == judged[place].window.piece for one in judged)
    return min(limits.WINDOWS_IN_A_ROW, beside)


def _spell(
    judged: Sequence[Judged],
    run: range,
    names: set[str],
    faults: Mapping[str, FaultSpec],
    needed: int,
) -> Spell:
    cause = None
    if names:
        throughout = _throughout(judged, run, names)
        cause = _cause(judged, throughout, [f for f in faults.values() if f.id in names])
    return Spell(run.start, run.stop, cause, len(run) < needed)


def _throughout(judged: Sequence[Judged], run: range, names: set[str]) -> list[int]:
    """Windows that distinguish faults: inner ones that any of them fits, and outer ones that all of
    them fit. In the others a fault begins or ends, or another one occurs."""
    inside = _inside(run)
    fitting = {i: names & _accepted(judged[i]) for i in run}
    return [i for i in run if fitting[i] and (i in inside or fitting[i] == names)]


def _inside(run: range) -> range:
    return run[1:-1] if len(run) > 2 else run


def _accepted(judged: Judged) -> set[str]:
    return {name for name, test in judged.tests.items() if test.fits}


def _fitting(judged: Sequence[Judged], run: range) -> set[str]:
    inside = _inside(run)
    counts = Counter(name for i in inside for name in _accepted(judged[i]))
    return {name for name, count in counts.items() if count >= limits.FITS_MOST * len(inside)}


def _cause(judged: Sequence[Judged], inside: Sequence[int], faults: Sequence[FaultSpec]) -> Cause:
    """The most probable of some faults; each sample counts once, though it is in two windows."""
    names = [fault.id for fault in faults]
    weight = 0.5 if len(inside) > 1 else 1.0
    evidence = np.zeros((len(names), 1))
    for i in inside:
        one = judged[i]
        assert one.plain is not None
        for row, name in enumerate(names):
            test = one.tests.get(name)
            evidence[row] -= 0.5 * weight * (test.chi if test else one.plain.chi)
    evidence = np.round(evidence, limits.SPELL_DECIMALS)
    prior = np.log([[fault.odds] for fault in faults])
    posterior, unprejudiced = (shares(e)[:, 0].tolist() for e in (evidence + prior, evidence))
    weighed = [Other(*one) for one in zip(names, posterior, unprejudiced, strict=True)]
    best = int(np.argmax(posterior))
    rivals, remote = rivals_of(weighed[best], weighed[:best] + weighed[best + 1 :])
    tests = [judged[i].tests[names[best]] for i in inside if names[best] in judged[i].tests]
    tests = [test for test in tests if test.fits] or tests
    degrees, u = np.array([t.degree for t in tests]), np.array([t.u for t in tests])
    degree = float(np.average(degrees, weights=1.0 / np.maximum(u, limits.LEAST_U_STORES) ** 2))
    # Lasting errors are the same in all windows: averaging does not reduce them.
    half = common.COVERAGE * float(np.hypot(np.median(u), np.std(degrees)))
    return Cause(names[best], degree, degree - half, degree + half, posterior[best], rivals, remote)
