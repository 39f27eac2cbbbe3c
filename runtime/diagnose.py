"""From a recording to findings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from runtime.isolate import Isolation, isolate
from runtime.observe import Observed, observe, points_of_samples, points_of_stretches, reason
from runtime.paper_mode import judge_by_paper
from runtime.plan import Array
from runtime.recording import Recording
from runtime.ruleset import FaultSpec, Ruleset
from runtime.stationary import LONGEST, Stretches, find_stretches, noise_of

THRESHOLD = 3.0
"""A residual is shown as non-zero beyond this many standard uncertainties."""

COVERAGE = 2.0
"""Bounds are the degree plus and minus this many standard uncertainties (about 95 %)."""

PLAUSIBLE = 0.05
"""A cause more probable than this in every stretch holds a run together."""

STEADY = 0.1
"""Relative change of a degree, beyond its scatter, that still counts as the same finding."""

ASIDE = ("blind",)
"""Kinds of stretches that say nothing, and so do not interrupt a finding."""

LOOK_BACK = 8
"""Stretches a new one is compared with."""

MENTION = 0.02
"""Alternatives less probable than this are not mentioned."""


@dataclass(frozen=True)
class Evidence:
    """A residual at the strongest point of a finding; flows in m3/s.

    `verdict` is ``+``, ``-``, ``0`` or ``invalid``; `expected` what the fault predicts.
    """

    residual: str
    value: float
    u: float
    threshold: float
    verdict: str
    expected: str


@dataclass(frozen=True)
class Finding:
    """A fault that fits, over a period; times in s."""

    fault: FaultSpec
    degree: float
    lower: float
    upper: float
    probability: float
    since: float
    until: float
    alternatives: tuple[tuple[str, float], ...]
    evidence: tuple[Evidence, ...]
    readings: tuple[tuple[str, float], ...]
    flows: tuple[tuple[str, float, float], ...]
    text: str


@dataclass(frozen=True)
class Period:
    """A period with a remark: why nothing was judged, or what does not fit."""

    since: float
    until: float
    text: str


@dataclass(frozen=True)
class Diagnosis:
    """What the recording says about the plant."""

    ruleset: Ruleset
    mode: str
    samples: int
    judged: int
    status: str
    findings: tuple[Finding, ...]
    unknown: tuple[Period, ...]
    not_judged: tuple[Period, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Verdict:
    """One stretch: ``ok``, ``fault`` (its index), ``unknown``, ``outside`` the calibrated range,
    or ``blind``."""

    kind: str
    fault: int
    text: str


def diagnose(recording: Recording, ruleset: Ruleset, mode: str = "default") -> Diagnosis:
    """Judge a recording.

    Parameters
    ----------
    mode : ``default`` compares whole residual vectors, ``paper`` is Eqs. 17-19 of the seed paper.
    """
    noise = {name: noise_of(values) for name, values in recording.values.items()}
    stretches = find_stretches(recording, ruleset, noise)
    notes = list(recording.notes)
    notes += [f"{name} is not in the recording" for name in recording.missing]
    if not len(stretches):
        period = Period(
            float(recording.time[0]), float(recording.time[-1]), "no settled stretch was found"
        )
        return Diagnosis(ruleset, mode, len(recording), 0, "C", (), (), (period,), tuple(notes))
    observed = observe(ruleset, points_of_stretches(recording, ruleset, stretches, noise))
    isolation = isolate(ruleset, observed)
    if mode == "paper":
        isolation = _by_paper(ruleset, observed, isolation)
    verdicts = [_verdict(ruleset, observed, isolation, i) for i in range(len(stretches))]
    findings, unknown, not_judged = _merge(
        recording, ruleset, stretches, observed, isolation, verdicts
    )
    judged = int(stretches.lengths[isolation.judged].sum())
    status = _status(findings, unknown, judged)
    return Diagnosis(
        ruleset,
        mode,
        len(recording),
        judged,
        status,
        tuple(findings),
        tuple(unknown),
        tuple(not_judged),
        tuple(notes),
    )


def _by_paper(ruleset: Ruleset, observed: Observed, isolation: Isolation) -> Isolation:
    """Put the paper's verdicts in the place of ours; its winner counts as certain."""
    paper = judge_by_paper(ruleset, observed)
    best = paper.degree.max(axis=0, initial=0.0)
    deviating = paper.deviating & (best > 0) & isolation.judged
    chosen = np.zeros_like(paper.degree)
    chosen[paper.winner(), np.arange(len(observed))] = deviating
    half = (paper.upper - paper.lower) / (2 * COVERAGE)
    return Isolation(
        isolation.judged,
        deviating,
        isolation.misfit,
        isolation.freedom,
        paper.degree,
        np.maximum(half, 1e-12),
        isolation.floor,
        np.where(chosen > 0, 0.0, np.inf),
        chosen,
    )


def _verdict(ruleset: Ruleset, observed: Observed, isolation: Isolation, point: int) -> _Verdict:
    """What one stretch says."""
    if not isolation.judged[point]:
        return _Verdict("blind", -1, _why_blind(ruleset, observed, point))
    if not isolation.deviating[point]:
        return _Verdict("ok", -1, "")
    outside = [name for name, flags in observed.extrapolated.items() if flags[point]]
    if outside:
        return _Verdict("outside", -1, _outside(ruleset, outside[0]))
    chances = isolation.probability[:, point]
    if chances.max(initial=0.0) <= 0:
        return _Verdict("unknown", -1, _unexplained(ruleset, observed, isolation, point))
    return _Verdict("fault", int(np.argmax(chances)), "")


def _why_blind(ruleset: Ruleset, observed: Observed, point: int) -> str:
    reasons = [
        reason(ruleset, observed, i, point)
        for i in range(len(ruleset.observers))
        if not observed.valid[i, point]
    ]
    return "; ".join(dict.fromkeys(reasons)) or "too few estimates of the same flow"


def _outside(ruleset: Ruleset, name: str) -> str:
    signal = ruleset.signal_by_id[name]
    assert signal.valid_from is not None
    assert signal.valid_to is not None
    low = (signal.valid_from - signal.offset) / signal.factor
    high = (signal.valid_to - signal.offset) / signal.factor
    return (
        f"nothing known fits: the estimates of the flow disagree while {name} is outside "
        f"{low:.4g} to {high:.4g} {signal.unit}, the range the plant was calibrated in"
    )


def _unexplained(ruleset: Ruleset, observed: Observed, isolation: Isolation, point: int) -> str:
    ratio = np.abs(observed.residuals[:, point]) / observed.residual_u[:, point]
    ratio[~np.isfinite(ratio)] = 0.0
    fired = [ruleset.residuals[i].id for i in np.argsort(-ratio) if ratio[i] > THRESHOLD][:3]
    names = ", ".join(fired) or "the residuals together"
    return f"nothing known fits: {names} deviate in a way that no single fault explains"


def _merge(
    recording: Recording,
    ruleset: Ruleset,
    stretches: Stretches,
    observed: Observed,
    isolation: Isolation,
    verdicts: list[_Verdict],
) -> tuple[list[Finding], list[Period], list[Period]]:
    """Join neighbouring stretches that say the same; blind ones do not interrupt a finding."""
    time = recording.time
    findings: list[Finding] = []
    periods: dict[str, list[Period]] = {"unknown": [], "outside": [], "blind": []}
    for kind, members in _runs(verdicts, isolation, _pauses(time, stretches)):
        since = float(time[stretches.first[members[0]]])
        until = float(time[stretches.last[members[-1]] - 1])
        if kind == "fault":
            findings.append(
                _finding(ruleset, observed, isolation, stretches, members, since, until)
            )
        elif kind in periods:
            periods[kind].append(Period(since, until, verdicts[members[0]].text))
    unknown = sorted([*periods["unknown"], *periods["outside"]], key=lambda p: p.since)
    return sorted(findings, key=lambda f: f.since), unknown, periods["blind"]


def _pauses(time: Array, stretches: Stretches) -> set[int]:
    """Stretches before which nothing was recorded for long."""
    if len(time) < 2:
        return set()
    limit = LONGEST * float(np.median(np.diff(time)))
    between = time[stretches.first[1:]] - time[stretches.last[:-1] - 1]
    return {int(i) + 1 for i in np.flatnonzero(between > limit)}


def _runs(
    verdicts: list[_Verdict], isolation: Isolation, pauses: set[int]
) -> Iterator[tuple[str, list[int]]]:
    """Runs of stretches that say the same, as (kind, stretches).

    Stretches with a fault belong together as long as one cause is plausible in all of them and
    the degree stays within its bounds. Stretches that cannot show the fault interrupt nothing;
    those that cannot be judged are reported apart. `pauses` are stretches after a long pause of
    the recording.
    """
    open_runs: dict[str, list[int]] = {}
    for i, verdict in enumerate(verdicts):
        track = verdict.kind if verdict.kind in ASIDE else "plant"
        members = open_runs.setdefault(track, [])
        if members and _cannot_see(verdicts, isolation, members, i):
            continue
        if members and (i in pauses or not _continues(verdicts, isolation, members, i)):
            yield verdicts[members[0]].kind, members
            members = open_runs[track] = []
        if track == "plant":
            for aside in ASIDE:
                if open_runs.get(aside):
                    yield aside, open_runs.pop(aside)
        members.append(i)
    for members in open_runs.values():
        if members:
            yield verdicts[members[0]].kind, members


def _cannot_see(
    verdicts: list[_Verdict], isolation: Isolation, members: list[int], point: int
) -> bool:
    """Is a stretch that looks healthy merely unable to show the fault of the run?"""
    last = members[-1]
    if verdicts[point].kind != "ok" or verdicts[last].kind != "fault":
        return False
    fault = verdicts[last].fault
    return bool(isolation.floor[fault, point] * THRESHOLD > isolation.degree[fault, last])


def _continues(
    verdicts: list[_Verdict], isolation: Isolation, members: list[int], point: int
) -> bool:
    """Does a stretch go on with a run?"""
    first, here = verdicts[members[0]], verdicts[point]
    if first.kind != here.kind:
        return False
    if here.kind in ASIDE:
        return first.text == here.text
    if here.kind != "fault":
        return True
    recent = members[-LOOK_BACK:]
    common = (isolation.probability[:, [*recent, point]] > PLAUSIBLE).all(axis=1)
    if not common.any():
        return False
    best = int(np.argmax(np.where(common, isolation.probability[:, point], 0.0)))
    before = isolation.degree[best, recent]
    # Systematic errors are shared by neighbouring stretches, so their scatter is the measure;
    # too few stretches have no scatter yet.
    spread = COVERAGE * before.std() if len(recent) > 2 else COVERAGE * isolation.u[best, point]
    change = abs(isolation.degree[best, point] - before.mean())
    return bool(change <= spread + STEADY * before.mean())


def _finding(
    ruleset: Ruleset,
    observed: Observed,
    isolation: Isolation,
    stretches: Stretches,
    members: list[int],
    since: float,
    until: float,
) -> Finding:
    """Sum a run up: degree weighted by precision, evidence at the strongest point."""
    best = int(np.argmax(isolation.probability[:, members].mean(axis=1)))
    fault = ruleset.faults[best]
    degrees, u = isolation.degree[best, members], isolation.u[best, members]
    weights = 1.0 / np.maximum(u, 1e-12) ** 2
    degree = float(np.sum(weights * degrees) / np.sum(weights))
    # Systematic errors do not average out over a run, so the uncertainty is that of one stretch;
    # the scatter of the stretches is added.
    half = COVERAGE * float(np.hypot(np.min(u), np.sqrt(np.average((degrees - degree) ** 2))))
    strongest = members[int(np.argmax(isolation.misfit[members]))]
    mean = isolation.probability[:, members].mean(axis=1)
    others = tuple(
        (ruleset.faults[i].id, float(mean[i]))
        for i in np.argsort(-mean, kind="stable")
        if i != best and mean[i] > MENTION
    )
    return Finding(
        fault,
        degree,
        max(degree - half, fault.lowest),
        min(degree + half, fault.highest),
        float(mean[best]),
        since,
        until,
        others,
        _evidence(ruleset, observed, fault, strongest),
        _readings(ruleset, observed, strongest),
        _flows(ruleset, observed, strongest),
        fault.text.replace("{degree}", _percent(degree)),
    )


def _percent(degree: float) -> str:
    return f"{100 * degree:.3g} %"


def _evidence(
    ruleset: Ruleset, observed: Observed, fault: FaultSpec, point: int
) -> tuple[Evidence, ...]:
    signs = {c.residual: c.sign for c in ruleset.cells_of_fault[fault.id]}
    index = {o.id: i for i, o in enumerate(ruleset.observers)}
    rows = []
    for i, residual in enumerate(ruleset.residuals):
        expected = {1: "+", -1: "-", 0: "0"}[signs.get(residual.id, 0)]
        value, u = float(observed.residuals[i, point]), float(observed.residual_u[i, point])
        usable = all(observed.valid[index[t.observer], point] for t in residual.terms)
        verdict = "invalid"
        if usable and np.isfinite(value) and np.isfinite(u):
            verdict = "0" if abs(value) <= THRESHOLD * u else ("+" if value > 0 else "-")
        else:
            value, u = 0.0, 0.0
        rows.append(Evidence(residual.id, value, u, THRESHOLD * u, verdict, expected))
    return tuple(rows)


def _readings(ruleset: Ruleset, observed: Observed, point: int) -> tuple[tuple[str, float], ...]:
    used = {s for o in ruleset.observers for s in o.signals}
    return tuple(
        (s.id, float(observed.points.values[s.id][point]))
        for s in ruleset.signals
        if s.id in used and s.id in observed.points.values
    )


def _flows(
    ruleset: Ruleset, observed: Observed, point: int
) -> tuple[tuple[str, float, float], ...]:
    spread = np.sqrt(np.sum(observed.gradients[:, :, point] ** 2, axis=1))
    return tuple(
        (o.id, float(observed.flows[i, point]), float(spread[i]))
        for i, o in enumerate(ruleset.observers)
        if observed.valid[i, point]
    )


def _status(findings: list[Finding], unknown: list[Period], judged: int) -> str:
    """NE 107 letter of the whole: F over C over S over M."""
    letters = {f.fault.status for f in findings} | ({"S"} if unknown else set())
    if not judged:
        letters.add("C")
    return next((letter for letter in "FCSM" if letter in letters), "ok")


@dataclass(frozen=True)
class Trace:
    """Per sample: verdict, and per fault degree and bounds, shape (faults, n)."""

    time: Array
    verdict: tuple[str, ...]
    degree: Array
    lower: Array
    upper: Array


def trace(recording: Recording, ruleset: Ruleset, mode: str = "default") -> Trace:
    """Judge every sample on its own, moving or not; for files and plots."""
    noise = {name: noise_of(values) for name, values in recording.values.items()}
    observed = observe(ruleset, points_of_samples(recording, ruleset, noise))
    isolation = isolate(ruleset, observed)
    if mode == "paper":
        isolation = _by_paper(ruleset, observed, isolation)
    words = []
    for i in range(len(recording)):
        verdict = _verdict(ruleset, observed, isolation, i)
        name = ruleset.faults[verdict.fault].id if verdict.kind == "fault" else verdict.kind
        words.append({"blind": "cannot judge", "outside": "unknown"}.get(name, name))
    fits = isolation.probability > 0
    degree = np.where(fits, isolation.degree, 0.0)
    half = np.where(fits, COVERAGE * isolation.u, 0.0)
    lower = np.maximum(degree - half, 0.0)
    return Trace(recording.time, tuple(words), degree, lower, degree + half)
