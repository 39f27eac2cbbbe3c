"""Count the outcomes of a study, pooled over the modules of a type."""

from collections import Counter
from collections.abc import Mapping, Sequence
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
    order = list(dict.fromkeys(kinds.values()))
    groups: dict[tuple[int, float], list[Outcome]] = {}
    for o in (o for o in outcomes if o.fault):
        groups.setdefault((order.index(kinds[o.fault]), o.degree), []).append(o)
    ran = [o for o in outcomes if o.kind != Kind.NO_POINT]
    faulty, healthy = [o for o in ran if o.fault], [o for o in ran if not o.fault]
    total = Counter(kinds[o.fault] for o in faulty)
    taken = Counter((kinds[o.fault], kinds[o.first]) for o in faulty if o.kind == Kind.OTHER)
    confusions = [Confusion(a, b, count, total[a]) for (a, b), count in taken.items()]
    # The most frequent confusion first.
    confusions.sort(key=lambda c: (-c.count / c.of, -c.count, c.fault.name))
    alarms = sum(o.kind in (Kind.OTHER, Kind.UNKNOWN) or o.early for o in healthy)
    early = sum(o.early for o in faulty)
    return Tally(
        cells=tuple(_cell(order[i], degree, groups[i, degree]) for i, degree in sorted(groups)),
        confusions=tuple(confusions),
        healthy=_alarms(alarms, len(healthy), samples + lead_in),
        lead_in=_alarms(early, len(faulty) if lead_in else 0, lead_in),
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


def _alarms(alarms: int, recordings: int, samples: int) -> Alarms:
    return Alarms(alarms, recordings, samples * recordings, upper_bound(alarms, recordings))


def upper_bound(count: int, of: int) -> float:
    """Upper bound of a rate with 95 % confidence, after `count` events in `of` trials.

    Source: Clopper and Pearson 1934, one-sided: a quantile of the beta distribution.
    """
    return float(betaincinv(count + 1, of - count, CONFIDENCE)) if count < of else 1.0
