"""Neighbouring windows with the same verdict, and which fault explains them.

Neighbours share half of their samples, so a persistent fault must fit in three in a row: the first
and the last of them share none. In a recording of fewer windows it must fit in all of them.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import FaultSpec
from rulec_runtime.diagnosis.steady.causes import Other, rivals_of
from rulec_runtime.diagnosis.steady.isolate import shares
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.judge_windows import Judged


@dataclass(frozen=True)
class Cause:
    """A fault that explains a deviation, with its alternatives."""

    fault: str
    degree: float
    lower: float
    upper: float
    probability: float
    rivals: tuple[tuple[str, float], ...]
    remote: tuple[tuple[str, float], ...]


@dataclass(frozen=True)
class Run:
    """Deviating windows in a row, by their numbers; `cause` is None if nothing known fits, `brief`
    if it does not persist, `since` when it begins, if that is known."""

    members: range
    cause: Cause | None
    brief: bool
    since: float | None = None

    @property
    def inside(self) -> range:
        """Those between the first and the last, if there are any."""
        return _inside(self.members)


Begun = Callable[[range], tuple[Cause, float] | None]
"""The cause that begins before a run of windows, and when."""


def deviating_runs(
    judged: Sequence[Judged], faults: Mapping[str, FaultSpec], begun: Begun
) -> list[Run]:
    """All runs of a recording; `faults` by id, in the order of the ruleset."""
    found: list[Run] = []
    for (_, deviating), run in groupby(
        range(len(judged)), lambda i: (judged[i].window.piece, judged[i].deviating)
    ):
        if deviating:
            first, *others = run
            members = range(first, first + 1 + len(others))
            cause = begun(members) if len(members) >= windows_needed(judged, first) else None
            if cause is None:
                found += _explained(judged, members, faults)
            else:
                found.append(Run(members, cause[0], False, cause[1]))
    return found


def _explained(judged: Sequence[Judged], run: range, faults: Mapping[str, FaultSpec]) -> list[Run]:
    """One fault for all windows of a run if there is one; else one after the other. If none of them
    persists, but the deviation does, nothing known fits."""
    needed, inside = windows_needed(judged, run[0]), _inside(run)
    counts = Counter(name for i in inside for name in judged[i].fitting)
    most = {name for name, count in counts.items() if count >= limits.FITS_MOST * len(inside)}
    found = [
        Run(part, _cause(judged, part, names, faults), len(part) < needed)
        for part, names in ([(run, most)] if most else _parts(judged, run))
    ]
    if len(run) >= needed and all(one.brief for one in found):
        return [Run(run, None, False)]
    return found


def _parts(judged: Sequence[Judged], run: range) -> Iterator[tuple[range, set[str]]]:
    """Parts of a run in which some faults fit throughout, or none does, with these faults."""
    first, fitting = run.start, judged[run.start].fitting
    for i in run[1:]:
        more = judged[i].fitting
        if fitting & more or not (fitting or more):
            fitting &= more
        else:
            yield range(first, i), fitting
            first, fitting = i, more
    yield range(first, run.stop), fitting


def windows_needed(judged: Sequence[Judged], index: int) -> int:
    """Number of windows in a row that a finding needs, in the piece of one of them."""
    beside = sum(one.window.piece == judged[index].window.piece for one in judged)
    return min(limits.WINDOWS_IN_A_ROW, beside)


def _inside(run: range) -> range:
    return run[1:-1] if len(run) > 2 else run


def _cause(
    judged: Sequence[Judged], run: range, among: set[str], faults: Mapping[str, FaultSpec]
) -> Cause | None:
    """The most probable of some faults; each sample counts once, though it is in two windows.

    Windows distinguish faults if they are inner ones that any of them fits, or outer ones that all
    of them fit. In the others a fault begins or ends, or another one occurs. A fault whose degree
    may as well be zero, as it differs from window to window, explains nothing.
    """
    fitting = {i: among & judged[i].fitting for i in run}
    inside = [i for i in run if fitting[i] and (i in _inside(run) or fitting[i] == among)]
    degrees = {n: _degree([judged[i] for i in inside], n) for n in faults if n in among}
    names = [name for name, (lower, _, upper) in degrees.items() if not lower <= 0.0 <= upper]
    if not names:
        return None
    left = [
        [
            one.tests[name].chi if name in one.tests else one.chi
            for one in map(judged.__getitem__, inside)
        ]
        for name in names
    ]
    weight = 0.5 if len(inside) > 1 else 1.0
    evidence = np.round(-0.5 * weight * np.sum(left, axis=1)[:, None], limits.EVIDENCE_DECIMALS)
    prior = np.log([[faults[name].odds] for name in names])
    posterior, unprejudiced = (shares(e)[:, 0].tolist() for e in (evidence + prior, evidence))
    weighed = [Other(*one) for one in zip(names, posterior, unprejudiced, strict=True)]
    best = int(np.argmax(posterior))
    rivals, remote = rivals_of(weighed[best], weighed[:best] + weighed[best + 1 :])
    lower, degree, upper = degrees[names[best]]
    return Cause(names[best], degree, lower, upper, posterior[best], rivals, remote)


def _degree(windows: Sequence[Judged], name: str) -> tuple[float, float, float]:
    """Lower bound, mean and upper bound of the degree of a fault over some windows."""
    tests = [one.tests[name] for one in windows if name in one.tests]
    tests = [test for test in tests if test.fits] or tests
    degrees, u = np.array([t.degree for t in tests]), np.array([t.u for t in tests])
    degree = float(np.average(degrees, weights=1.0 / np.maximum(u, limits.LEAST_U_STORES) ** 2))
    # Lasting errors are the same in all windows: averaging does not reduce them.
    half = common.COVERAGE * float(np.hypot(np.median(u), np.std(degrees)))
    return degree - half, degree, degree + half
