"""Count the outcomes of a study, pooled over the modules of a type."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from scipy.special import betaincinv

from rulec.study.campaign import Kind, Outcome
from rulec.study.limits import CONFIDENCE


@dataclass(frozen=True)
class FaultKind:
    """A fault of a module type; `name` and `title` do not contain the module."""

    type: str
    name: str
    title: str


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One fault kind at one degree.

    `kinds` counts all recordings by outcome, `shared` those in which the true fault was only an
    alternative. For those in which it was named first, `covered` counts bounds that hold the true
    degree; `error` and `bias` are the means of the degree's absolute and signed error.
    """

    fault: FaultKind
    degree: float
    kinds: Mapping[Kind, int]
    shared: int
    covered: int
    error: float
    bias: float

    @property
    def recordings(self) -> int:
        """Number of recordings for which the plant has an operating point."""
        return sum(self.kinds.values()) - self.kinds[Kind.NO_POINT]

    @property
    def named(self) -> int:
        """Number of recordings in which the true fault was named first."""
        return self.kinds[Kind.NAMED]

    @property
    def found(self) -> int:
        """Number of recordings in which the diagnosis reported something."""
        return self.named + self.kinds[Kind.OTHER] + self.kinds[Kind.UNKNOWN]


@dataclass(frozen=True)
class Confusion:
    """A fault taken for another one: `count` of `of` recordings of the former."""

    fault: FaultKind
    taken_for: FaultKind
    count: int
    of: int


@dataclass(frozen=True)
class Alarms:
    """False alarms in healthy recordings, with an upper bound for their rate."""

    alarms: int
    recordings: int
    samples: int
    bound: float


@dataclass(frozen=True)
class Tally:
    """All counts of a study; `lead_in` counts the healthy samples before faults."""

    cells: tuple[Cell, ...]
    confusions: tuple[Confusion, ...]
    healthy: Alarms
    lead_in: Alarms


def tally(
    ruleset: Ruleset,
    types: Mapping[str, str],
    outcomes: Sequence[Outcome],
    samples: int,
    lead_in: int,
) -> Tally:
    """Count outcomes. `types` are module types by module, `samples` and `lead_in` the lengths of a
    healthy recording and of the healthy part of a faulty one."""
    kinds = {}
    for f in ruleset.faults:
        name, title = (text.removeprefix(f"{f.module}.") for text in (f.id, f.title))
        kinds[f.id] = FaultKind(types[f.module], name, title)
    groups: dict[tuple[FaultKind, float], list[Outcome]] = {}
    for kind in kinds.values():
        for degree in sorted({o.degree for o in outcomes if o.fault}):
            groups.setdefault((kind, degree), [])
    for outcome in outcomes:
        if outcome.fault:
            groups[kinds[outcome.fault], outcome.degree].append(outcome)
    faulty = [o for o in outcomes if o.fault and o.kind != Kind.NO_POINT]
    healthy = [o for o in outcomes if not o.fault and o.kind != Kind.NO_POINT]
    alarms = sum(o.kind in (Kind.OTHER, Kind.UNKNOWN) or o.early for o in healthy)
    early = sum(o.early for o in faulty)
    return Tally(
        tuple(_cell(kind, degree, part) for (kind, degree), part in groups.items() if part),
        _confusions(kinds, faulty),
        _alarms(alarms, len(healthy), samples + lead_in),
        _alarms(early, len(faulty) if lead_in else 0, lead_in),
    )


def _cell(fault: FaultKind, degree: float, outcomes: Sequence[Outcome]) -> Cell:
    kinds = Counter(o.kind for o in outcomes)
    named = [o for o in outcomes if o.kind == Kind.NAMED]
    errors = np.array([o.estimate - o.degree for o in named])
    return Cell(
        fault=fault,
        degree=degree,
        kinds={kind: kinds[kind] for kind in Kind},
        shared=sum(o.shared for o in outcomes if o.kind == Kind.OTHER),
        covered=sum(o.lower <= o.degree <= o.upper for o in named),
        error=float(np.mean(np.abs(errors))) if named else 0.0,
        bias=float(np.mean(errors)) if named else 0.0,
    )


def _confusions(kinds: Mapping[str, FaultKind], faulty: Iterable[Outcome]) -> tuple[Confusion, ...]:
    """Which fault was named first instead of which, the most frequent confusion first."""
    total: Counter[FaultKind] = Counter()
    count: Counter[tuple[FaultKind, FaultKind]] = Counter()
    for outcome in faulty:
        total[kinds[outcome.fault]] += 1
        if outcome.kind == Kind.OTHER:
            count[kinds[outcome.fault], kinds[outcome.first]] += 1
    found = [Confusion(a, b, n, total[a]) for (a, b), n in count.items()]
    return tuple(sorted(found, key=lambda c: (-c.count / c.of, -c.count, c.fault.name)))


def _alarms(alarms: int, recordings: int, samples: int) -> Alarms:
    return Alarms(alarms, recordings, samples * recordings, upper_bound(alarms, recordings))


def upper_bound(count: int, of: int) -> float:
    """Upper bound of a rate with 95 % confidence, after `count` events in `of` trials.

    Source: Clopper and Pearson 1934, one-sided: a quantile of the beta distribution.
    """
    return float(betaincinv(count + 1, of - count, CONFIDENCE)) if count < of else 1.0
