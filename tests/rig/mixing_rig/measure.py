"""From answers to figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array

from tests.rig.mixing_rig.cases import PUMPS
from tests.rig.mixing_rig.judge import Answer, Covered, Named, Samples

CERTAIN = 0.95
REMARKS = ("ok", "unknown", "cannot judge", "moving")
"""Verdicts on a sample that name no fault."""

ROWS = (-0.5, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.5)
COLUMNS = ("0", "0.2", "0.4", "0.6", ">0.8")
# Edges midway between the rows, the outer ones open; a column holds two of our degrees, 0.8 alone
# the last, as the paper's last column says ">".
ROW_EDGES = tuple((a + b) / 2 for a, b in pairwise(ROWS))
COLUMN_EDGES = (0.15, 0.35, 0.55, 0.75)


@dataclass(frozen=True)
class SampleFigures:
    """Of all samples on plateaus with a fault, each judged on its own.

    `named`: share of them. Errors, bias, bounds: of those. `alarmed`: share of healthy samples.
    """

    faulty: int
    named: float
    error: float
    bias: float
    covered: float
    above: float
    healthy: int
    alarmed: float


@dataclass(frozen=True)
class DegreeFigures:
    """Of all stationary points: how many were named rightly, wrongly, as unknown, or not at all.

    `error`, `bias`, `covered`, `width`: of those named rightly; `error_any`: of all named.
    """

    points: int
    right: int
    wrong: int
    unknown: int
    silent: int
    error: float
    bias: float
    error_any: float
    covered: float
    width: float


@dataclass(frozen=True)
class IsolationFigures:
    """Shares of all points.

    `first`: the most probable fault is the true one; `possible`: the true one is it or an
    alternative; `shared`: that counted by 1 / number of causes mentioned; `certain_wrong`: another
    fault, more probable than CERTAIN, without mention of the true one; `extra`: more than one
    fault at once.
    """

    points: int
    first: float
    possible: float
    shared: float
    certain_wrong: float
    extra: float
    unknown: float
    silent: float


@dataclass(frozen=True)
class PairFigures:
    """Shares of all points with two faults; `one` and `wrong` count what is named besides, too."""

    points: int
    both: float
    one: float
    wrong: float
    unknown: float
    silent: float
    error: float


@dataclass(frozen=True)
class AlarmFigures:
    """Of fault-free recordings: samples and recordings with a fault named, and with a remark.

    `alone_*`: samples judged on their own; `moving` are not judged.
    """

    recordings: int
    samples: int
    fault: int
    unknown: int
    recordings_with_fault: int
    named: tuple[str, ...]
    alone_judged: int
    alone_fault: int
    alone_unknown: int


def sample_figures(parts: Sequence[Samples], fault: str) -> SampleFigures:
    """Figures of a replay; transients and what the tool calls moving are left out."""
    true, degree, lower, upper = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("true", "degree", "lower", "upper")
    )
    verdict = np.concatenate([np.array(p.verdict) for p in parts])
    settled = verdict != "moving"
    faulty = settled & (true > 0.05)
    named = faulty & (verdict == fault)
    healthy = settled & (true < 1e-3)
    alarmed = healthy & ~np.isin(verdict, REMARKS)
    off = degree[named] - true[named]
    return SampleFigures(
        int(faulty.sum()),
        _share(named.sum(), faulty.sum()),
        _mean(np.abs(off)),
        _mean(off),
        _mean((lower[named] <= true[named]) & (true[named] <= upper[named])),
        _mean(true[named] > upper[named]),
        int(healthy.sum()),
        _share(alarmed.sum(), healthy.sum()),
    )


def degree_figures(answers: Sequence[Answer]) -> DegreeFigures:
    """Figures of single faults."""
    right = [a for a in answers if a.named and a.named[0].fault in a.true]
    wrong = [a for a in answers if a.named and a.named[0].fault not in a.true]
    unknown = sum(not a.named and a.unknown for a in answers)
    off = np.array([discrepancy(a) for a in right])
    any_off = np.array([discrepancy(a) for a in [*right, *wrong]])
    inside = [a.named[0].lower <= a.true[a.named[0].fault] <= a.named[0].upper for a in right]
    return DegreeFigures(
        len(answers),
        len(right),
        len(wrong),
        unknown,
        len(answers) - len(right) - len(wrong) - unknown,
        _mean(np.abs(off)),
        _mean(off),
        _mean(np.abs(any_off)),
        _mean(np.array(inside)),
        _mean(np.array([a.named[0].upper - a.named[0].lower for a in right])),
    )


def discrepancy(answer: Answer) -> float:
    """Degree of the first fault named, less the true degree."""
    (true,) = answer.true.values()
    return answer.named[0].degree - true


def figure_11(answers: Iterable[Answer]) -> Array:
    """Share of the rightly named cases by discrepancy (rows) and true degree (columns)."""
    right = [a for a in answers if a.named and a.named[0].fault in a.true]
    table = np.zeros((len(ROWS), len(COLUMNS)))
    for answer in right:
        row = np.searchsorted(ROW_EDGES, discrepancy(answer))
        table[row, np.searchsorted(COLUMN_EDGES, answer.set_degree)] += 1.0 / len(right)
    return table


def isolation_figures(answers: Sequence[Answer]) -> IsolationFigures:
    """Figures of single faults, for their names only."""
    causes = [_causes(a) for a in answers]
    possible = np.array([not c.isdisjoint(a.true) for a, c in zip(answers, causes, strict=True)])
    size = np.array([max(len(c), 1) for c in causes])
    return IsolationFigures(
        len(answers),
        _mean(np.array([bool(a.named) and a.named[0].fault in a.true for a in answers])),
        _mean(possible),
        _mean(possible / size),
        _mean(np.array([_certain_wrong(a) for a in answers])),
        _mean(np.array([len(a.named) > 1 for a in answers])),
        _mean(np.array([not a.named and a.unknown for a in answers])),
        _mean(np.array([not a.named and not a.unknown for a in answers])),
    )


def pair_figures(answers: Sequence[Answer]) -> PairFigures:
    """Figures of two faults at once."""
    hits = np.array([len({n.fault for n in a.named} & set(a.true)) for a in answers])
    some = np.array([bool(a.named) for a in answers])
    unknown = np.array([not a.named and a.unknown for a in answers])
    off = [
        abs(n.degree - a.true[n.fault])
        for a, h in zip(answers, hits, strict=True)
        if h == 2
        for n in a.named
        if n.fault in a.true
    ]
    return PairFigures(
        len(answers),
        _mean(hits == 2),
        _mean(hits == 1),
        _mean(some & (hits == 0)),
        _mean(unknown),
        _mean(~some & ~unknown),
        _mean(np.array(off)),
    )


def alarm_figures(covered: Sequence[Covered], samples: Sequence[Samples]) -> AlarmFigures:
    """Figures of fault-free recordings."""
    verdict = np.concatenate([np.array(s.verdict) for s in samples])
    return AlarmFigures(
        len(covered),
        sum(c.samples for c in covered),
        sum(c.fault for c in covered),
        sum(c.unknown for c in covered),
        sum(bool(c.findings) for c in covered),
        tuple(sorted({name for c in covered for name in c.findings})),
        int((verdict != "moving").sum()),
        int((~np.isin(verdict, REMARKS)).sum()),
        int((verdict == "unknown").sum()),
    )


def kind_of(answer: Answer) -> str:
    """Type of the true fault and of its module: `dp.high, membrane`."""
    (fault,) = answer.true
    module, _, kind = fault.partition(".")
    return f"{kind}, {PUMPS[answer.plant][module]}"


def grouped(answers: Iterable[Answer], key: Callable[[Answer], str]) -> Mapping[str, list[Answer]]:
    """Answers by what `key` says of them, in order of the first."""
    groups: dict[str, list[Answer]] = {}
    for answer in answers:
        groups.setdefault(key(answer), []).append(answer)
    return groups


def _causes(answer: Answer) -> set[str]:
    """All faults mentioned."""
    return {name for n in answer.named for name in (n.fault, *n.alternatives)}


def _certain_wrong(answer: Answer) -> bool:
    def sure(named: Named) -> bool:
        return named.fault not in answer.true and named.probability > CERTAIN

    return _causes(answer).isdisjoint(answer.true) and any(sure(n) for n in answer.named)


def _share(part: int | np.integer, whole: int | np.integer) -> float:
    return float(part / whole) if whole else float("nan")


def _mean(values: Array | NDArray[np.bool_]) -> float:
    return float(np.mean(values)) if len(values) else float("nan")
