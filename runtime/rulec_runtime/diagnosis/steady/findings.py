"""Findings: a fault over a period, with its evidence."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.degree import degree_in_words
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import FaultSpec, Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.causes import Cause, causes_of
from rulec_runtime.diagnosis.steady.combine import ENDED, ONSET, Fit, Fits, fits_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.evidence import Evidence, Latest, evidence_at
from rulec_runtime.diagnosis.steady.growth import Growth
from rulec_runtime.diagnosis.steady.liquid import by_temperature, with_temperature
from rulec_runtime.diagnosis.steady.persistence import runs_of, strongest_of, too_brief
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.diagnosis.steady.redundancy import thinned
from rulec_runtime.diagnosis.steady.regimes import RegimeFinding
from rulec_runtime.diagnosis.steady.verdict import (
    Off,
    Verdict,
    disagreeing,
    only_lost,
    partly_blind,
    verdict_at,
)
from rulec_runtime.recordings.plant_calendar import ENDED as OVER
from rulec_runtime.recordings.plant_calendar import TO_THE_END, UNJUDGED, UNSETTLED, duration
from rulec_runtime.recordings.stationary import Timeline


@dataclass(frozen=True, kw_only=True)
class Step:
    """A change of inputs that distinguishes a finding from its alternatives, proposed by a
    simulation.

    `changes` per input: signal, from, to, SI; empty if no permitted change would help. `apart` per
    alternative: its name, its distance from the finding now and with the change, standard
    deviations. The change takes at least `ramp` seconds, and is then held for `dwell` seconds.
    `costs` names inputs and modules that cost product.
    """

    changes: tuple[tuple[str, float, float], ...]
    apart: tuple[tuple[str, float, float], ...]
    ramp: float
    dwell: float
    costs: tuple[str, ...]
    text: str


@dataclass(frozen=True, kw_only=True)
class Events:
    """Statistics of an intermittent fault: number, samples, mean duration, s, share of the
    recording, and the range of each input meanwhile, SI."""

    count: int
    samples: int
    duration: float
    share: float
    settings: Mapping[str, tuple[float, float]]

    @property
    def text(self) -> str:
        """In words."""
        return f"comes and goes: {self.count} times, about {duration(self.duration)} each"


@dataclass(frozen=True)
class Finding:
    """A fault that fits, over a period; times in s.

    `alternatives` fit about as well, `remote` ones hardly; `together` are simultaneous faults
    without which this one does not explain the readings. `baseline` is the number of fault-free
    stretches that the residuals are compared with. `behind` says what follows it: see
    `rulec_runtime.recordings.plant_calendar`. `step` would distinguish it from its alternatives.
    `from_sheet`: the plant never agreed with its sheet. `growth` is its present size, if it is
    still there. `events`: it is intermittent.
    """

    fault: FaultSpec
    degree: float
    lower: float
    upper: float
    probability: float
    since: float
    until: float
    alternatives: tuple[tuple[str, float], ...]
    remote: tuple[tuple[str, float], ...]
    together: tuple[str, ...]
    evidence: tuple[Evidence, ...]
    readings: tuple[tuple[str, float], ...]
    flows: tuple[tuple[str, float, float], ...]
    baseline: int
    text: str
    behind: str | None = OVER
    step: Step | None = None
    from_sheet: bool = False
    growth: Growth | None = None
    events: Events | None = None

    @property
    def active(self) -> bool:
        """Whether it was still there when it was last detectable."""
        return self.behind is not OVER

    @property
    def is_alone(self) -> bool:
        """Whether no other cause that may be mentioned fits: they would have the rest of the
        probability. Without others the rest is time in which this one does not fit."""
        others = self.alternatives or self.remote
        return not others and self.probability >= 1.0 - limits.MENTION

    @property
    def is_contradicted(self) -> bool:
        """Whether a residual moved against its prediction, with no other fault beside it."""
        return not self.together and any(
            {e.verdict, e.expected} == {"+", "-"} for e in self.evidence
        )


@dataclass(frozen=True)
class Period:
    """A period with a remark: why nothing was judged, or what does not fit.

    `off` are the residuals that disagree most, see `disagreeing`. `from_sheet`: the plant never
    agreed with its sheet. `partly`: the rest was judged; `lost`: missing readings are the only
    reason; `rests`: modules at standstill are.
    """

    since: float
    until: float
    text: str
    off: tuple[Off, ...] = ()
    from_sheet: bool = False
    partly: bool = False
    lost: bool = False
    rests: bool = False


@dataclass(frozen=True, kw_only=True)
class Visited:
    """Mean readings of some settled stretches, spread evenly over those that were judged.

    `since`, `until` (s) and `samples` of each, shape (n,); `values` and standard uncertainties `u`
    per signal, shape (n,), SI.
    """

    since: Array
    until: Array
    samples: np.ndarray
    values: Mapping[str, Array]
    u: Mapping[str, Array]


@dataclass(frozen=True)
class Found:
    """Results of a block of estimates over a recording, and all residuals at its end; for the whole
    plant also the regimes of its modules, some visited points, and the faults detectable `without`
    readings that were removed."""

    findings: list[Finding]
    unknown: list[Period]
    not_judged: list[Period]
    latest: Latest | None = None
    regimes: tuple[RegimeFinding, ...] = ()
    visited: Visited | None = None
    without: frozenset[str] = frozenset()


def findings_of(timeline: Timeline, ruleset: Ruleset, evaluated: EvaluatedPoints) -> Found:
    """Join neighbouring stretches with the same verdict; blind ones do not interrupt a finding."""
    # Equal verdicts are shared.
    same: dict[Verdict, Verdict] = {}
    each = (verdict_at(evaluated, i) for i in range(len(timeline)))
    verdicts = [same.setdefault(verdict, verdict) for verdict in each]
    found = Found([], [], _in_part(timeline, evaluated))
    before: frozenset[int] = frozenset()
    pauses = set(np.flatnonzero(timeline.paused).tolist())
    # Stretches in which a reading in use moves.
    lag = (evaluated.points.lag.get(name) for name in ruleset.observed)
    slow = {i for own in lag if own is not None for i in np.flatnonzero(own).tolist()}
    runs = []
    for kind, members in runs_of(verdicts, evaluated.isolation, pauses, slow):
        # Of other runs, which may be long, only the first and last stretch are needed.
        brief = kind == "fault" and too_brief(evaluated, timeline, members)
        whole = kind in ("fault", "unknown")
        runs.append(("brief" if brief else kind, members if whole else [members[0], members[-1]]))
    fits = _fits(evaluated, [members for kind, members in runs if kind == "fault"])
    for kind, members in runs:
        since, until = float(timeline.since[members[0]]), float(timeline.until[members[-1]])
        verdict = verdicts[members[0]]
        if kind == "ok":
            before = frozenset()
        elif kind == "brief":
            fault = evaluated.part.ruleset.faults[verdict.faults[0]]
            text = f"{fault.id} would fit, but a finding takes {common.PERSISTENCE} samples"
            found.not_judged.append(Period(since, until, text))
        elif kind == "blind":
            lost, rests = verdict.lost, verdict.rests
            found.not_judged.append(Period(since, until, verdict.text, lost=lost, rests=rests))
        elif kind != "fault":
            off = disagreeing(evaluated, strongest_of(evaluated, members))
            found.unknown.append(Period(since, until, verdict.text, off))
        else:
            fitted = by_temperature(evaluated, members, _evident(evaluated, members, next(fits)))
            causes = causes_of(evaluated, members, fitted, before)
            before = frozenset(cause.fault for cause in causes)
            for cause in causes:
                times = _when(timeline, evaluated, cause, members)
                one = finding_of(ruleset, evaluated, cause, members, times)
                if evaluated.combined and one.is_contradicted:
                    text = f"nothing known fits: the evidence contradicts {one.fault.id}"
                    off = disagreeing(evaluated, strongest_of(evaluated, members))
                    found.unknown.append(Period(*times, text, off))
                else:
                    over = cause.when == ENDED
                    behind = OVER if over else behind_of(timeline, evaluated, members)
                    found.findings.append(replace(one, behind=behind))
    return found


def _fits(evaluated: EvaluatedPoints, runs: list[list[int]]) -> Iterator[Fits]:
    """Fits of each run; none without combined points."""
    if not evaluated.combined:
        return (Fits([], 0) for _ in runs)
    ruleset, isolation = evaluated.part.ruleset, evaluated.isolation
    return iter(fits_of(ruleset, evaluated.plain, evaluated.baselines, isolation, runs))


def _evident(evaluated: EvaluatedPoints, members: list[int], fits: Fits) -> Fits:
    """Fits of a run without single faults whose prediction a residual contradicts where it is
    worst."""
    ruleset, signs = evaluated.part.ruleset, {"+": 1, "-": -1}
    rows = evidence_at(evaluated, strongest_of(evaluated, members)) if fits.tried else ()
    moved = {e.residual: signs.get(e.verdict, 0) for e in rows}
    against = {c.fault for c in ruleset.cells if c.sign * moved.get(c.residual, 0) < 0}

    def stands(fit: Fit) -> bool:
        alone = len(fit.faults) == 1 and fit.when != ENDED
        return not (alone and ruleset.faults[fit.faults[0]].id in against)

    return replace(fits, tried=[fit for fit in fits.tried if stands(fit)])


def _when(
    timeline: Timeline, evaluated: EvaluatedPoints, cause: Cause, members: list[int]
) -> tuple[float, float]:
    """First and last time of a cause: that of the run, of its baseline, or of both."""
    first, last = members[0], members[-1]
    if cause.when != ONSET:
        learned = evaluated.baselines.learned_at(first)
        first, last = learned[0], learned[-1] if cause.when == ENDED else last
    return float(timeline.since[first]), float(timeline.until[last])


def behind_of(timeline: Timeline, evaluated: EvaluatedPoints, members: list[int]) -> str | None:
    """What follows a run: judged stretches, the end, or rows that could not be judged."""
    last = members[-1]
    if evaluated.isolation.judged[last + 1 :].any():
        return OVER
    if timeline.later[last] < common.PERSISTENCE:
        return TO_THE_END
    return UNSETTLED if last + 1 == len(timeline) else UNJUDGED


def _in_part(timeline: Timeline, evaluated: EvaluatedPoints) -> list[Period]:
    """Periods in which some estimates were missing, neighbouring ones joined."""
    found: list[Period] = []
    last = ""
    whole = np.asarray(evaluated.observed.valid.all(axis=0))
    for flags in evaluated.observed.points.stood_in.values():
        whole &= ~flags
    for i in range(len(timeline)):
        text = "" if whole[i] else partly_blind(evaluated, i)
        since, until = float(timeline.since[i]), float(timeline.until[i])
        if text and text == last:
            found[-1] = replace(found[-1], until=until)
        elif text:
            found.append(Period(since, until, text, partly=True, lost=only_lost(evaluated, i)))
        last = text
    return found


def finding_of(
    ruleset: Ruleset,
    evaluated: EvaluatedPoints,
    cause: Cause,
    members: list[int],
    times: tuple[float, float],
) -> Finding:
    """A cause with its evidence at the strongest point of a run."""
    own = evaluated.part.ruleset
    fault = own.faults[cause.fault]
    strongest = strongest_of(evaluated, members)
    cause, further = with_temperature(evaluated, members, cause)
    text = fault.text.replace("{degree}", degree_in_words(fault, cause.degree))
    values, observed = evaluated.points.values, evaluated.observed
    readings = tuple(
        (s.id, float(values[s.id][strongest]))
        for s in ruleset.signals
        if s.id in ruleset.observed and s.id in values
    )
    net = observed.flows[:, strongest] - observed.offsets[:, strongest]
    assert observed.u is not None
    flows = tuple(
        (o.id, float(net[i]), float(observed.u[i, strongest]))
        for i, o in enumerate(own.observers)
        if observed.valid[i, strongest]
    )
    return Finding(
        fault,
        cause.degree,
        max(cause.lower, fault.lowest),
        min(cause.upper, fault.highest),
        cause.probability,
        *times,
        tuple((own.faults[i].id, p) for i, p in cause.rivals),
        tuple((own.faults[i].id, p) for i, p in cause.remote),
        tuple(own.faults[i].id for i in cause.together),
        evidence_at(evaluated, strongest, fault, ended=cause.when == ENDED),
        readings,
        flows,
        len(evaluated.baselines.learned_at(members[0])),
        f"{text}{further}",
    )


def visited_of(timeline: Timeline, points: Points, judged: np.ndarray) -> Visited:
    """Points of a recording by flags of what was judged, shape (points,)."""
    some = thinned(np.flatnonzero(judged), limits.VISITED)
    own = points.at(some)
    return Visited(
        since=timeline.since[some],
        until=timeline.until[some],
        samples=timeline.samples[some],
        values=own.values,
        u=own.u,
    )
