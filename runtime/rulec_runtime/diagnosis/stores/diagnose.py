"""Diagnosis of a plant that stores: its balances fitted to a moving window of the recording.

windows -> usual misfit -> judge -> runs -> findings. The result types are those of a plant that
settles, so reports, plots and files are the same.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rulec_runtime.contract.degree import degree_in_words
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.findings import Finding, Found, Period
from rulec_runtime.diagnosis.stores import limits
from rulec_runtime.diagnosis.stores.evidence import evidence_of, latest_of
from rulec_runtime.diagnosis.stores.free_balances import with_free_states
from rulec_runtime.diagnosis.stores.joined_windows import Cause, Run, deviating_runs
from rulec_runtime.diagnosis.stores.judge_windows import Judged, Weighed, weighed
from rulec_runtime.diagnosis.stores.onset import cause_of
from rulec_runtime.diagnosis.stores.windows import NO_READING, windows_of
from rulec_runtime.recordings.plant_calendar import BRIEFLY_GONE, ENDED, TO_THE_END, UNJUDGED
from rulec_runtime.recordings.recording import Recording


@dataclass(frozen=True, kw_only=True)
class StoresJudged:
    """Judgement of a recording of a plant that stores; `covered` flags its judged samples."""

    judged: Sequence[Judged]
    found: Found
    notes: tuple[str, ...]
    covered: np.ndarray


def judge_stores(recording: Recording, ruleset: Ruleset) -> StoresJudged:
    """Judge a recording of a plant that stores."""
    found = weighed(ruleset, windows_of(recording, ruleset))
    runs = deviating_runs(found.judged, ruleset.fault_by_id, partial(cause_of, found))
    result = Found([], [], _not_judged(found), latest_of(found))
    for run in runs:
        (since, until), cause = _times(found, run), run.cause
        if run.brief and not _beside_another(runs, run):
            what = f"{cause.fault} would fit" if cause else "the balances do not fit"
            text = f"{what}, but a finding takes {limits.WINDOWS_IN_A_ROW} windows in a row"
            result.not_judged.append(Period(since, until, text))
        elif not run.brief and cause is None:
            result.unknown.append(Period(since, until, _unknown(found, run)))
        elif not run.brief and cause is not None:
            result.findings.append(_finding(found, runs, run, cause))
    covered = np.zeros(len(recording), dtype=bool)
    for one in found.judged:
        if one.plain is not None:
            begin, end = one.window.time[[0, -1]]
            covered |= (recording.time >= begin) & (recording.time <= end)
    notes = tuple(_notes(found))
    return StoresJudged(judged=found.judged, found=result, notes=notes, covered=covered)


def _times(found: Weighed, run: Run) -> tuple[float, float]:
    first, last = (found.judged[run.members[end]].window for end in (0, -1))
    return float(first.time[0]), float(last.time[-1])


def _beside_another(runs: Sequence[Run], own: Run) -> bool:
    """Whether it is the edge of a run that is reported anyway."""
    first, behind = own.members.start, own.members.stop
    return any(
        not other.brief and other.members.start <= behind and first <= other.members.stop
        for other in runs
    )


def _unknown(found: Weighed, run: Run) -> str:
    """The reading that the balances miss most, and by how much where they begin to."""
    beyond = [e for e in evidence_of(found, run, None) if e.verdict in ("+", "-")]
    if beyond:
        most = max(beyond, key=lambda e: abs(e.value) / e.u)
        signal = found.model.ruleset.signal_by_id[most.residual]
        size = f"{abs(most.value) / signal.factor:.2g} {signal.unit}"
        where = "above" if most.value > 0.0 else "below"
        return (
            f"nothing known fits: {signal.id} is soon {size} {where} what the balances predict, "
            "and no known fault moves it like that"
        )
    outputs = found.model.dynamics.outputs
    off = np.zeros(len(outputs))
    for plain in (found.judged[i].plain for i in run.members):
        if plain is not None:
            off += np.nan_to_num((plain.error / found.model.spread) ** 2).sum(axis=0)
    what = f"{outputs[int(np.argmax(off))]} moves in a way that the balances explain with no known"
    return f"nothing known fits: {what} fault"


def _finding(found: Weighed, runs: Sequence[Run], run: Run, cause: Cause) -> Finding:
    fault, judged = found.model.ruleset.fault_by_id[cause.fault], found.judged
    first, last = run.members[0], run.members[-1]
    since, until = _times(found, run)
    if run.since is not None:
        since = run.since
    elif sound := _sound(judged, range(first - 1, -1, -1), first, fault.id):
        since = _edge(found, sound, judged[run.inside[0]], cause)
    if sound := _sound(judged, range(last + 1, len(judged)), last, fault.id):
        until = max(_edge(found, sound, judged[run.inside[-1]], cause), since)
    strongest = judged[max(run.inside, key=lambda i: judged[i].chi)]
    return Finding(
        fault,
        cause.degree,
        max(cause.lower, fault.lowest),
        min(cause.upper, fault.highest),
        cause.probability,
        since,
        until,
        cause.rivals,
        cause.remote,
        (),
        evidence_of(found, run, cause),
        tuple(_readings(found, strongest)),
        (),
        strongest.prior.windows,
        fault.text.replace("{degree}", degree_in_words(fault, cause.degree)),
        _behind(found, runs, run, fault.id, until),
    )


def _edge(found: Weighed, sound: Judged, faulty: Judged, cause: Cause) -> float:
    """The time between a sound window and a faulty one at which the fault begins, or ends, if the
    faulty one comes first."""
    begins = sound.window.first < faulty.window.first
    one, other = (sound, faulty) if begins else (faulty, sound)
    window = found.windows.joined(one.window, other.window)
    balances = with_free_states(found.model.dynamics, (f"x.{cause.fault}",))
    moved, time = replace(found.model, balances=balances), window.time
    assert one.plain is not None
    window = found.model.with_errors(window, one.plain.unknowns)
    guess, best, when = one.plain.unknowns, np.inf, float(time[0])
    firsts = np.unique(np.linspace(0, len(time) - 1, limits.EDGE_TIMES).astype(int))
    for first in firsts.tolist():
        later = np.arange(len(time)) >= first
        course = np.where(later == begins, cause.degree, 0.0)
        own = replace(window, inputs=np.column_stack([window.inputs, course]))
        fitted = moved.fit(own, sound.prior, guess)
        if fitted is not None and fitted.chi < best:
            best, when, guess = fitted.chi, float(time[first]), fitted.unknowns
    return when


def _sound(judged: Sequence[Judged], order: range, beside: int, fault: str) -> Judged | None:
    """The nearest window of the same piece that would show a fault but does not, if only brief
    deviations are in between."""
    for i in order:
        one = judged[i]
        if one.window.piece != judged[beside].window.piece or one.plain is None:
            return None
        if not one.deviating:
            return one if fault in one.floor else None
        if abs(i - beside) > limits.WINDOWS_IN_A_ROW:
            return None
    return None


def _behind(found: Weighed, runs: Sequence[Run], run: Run, fault: str, until: float) -> str | None:
    """What follows a run: as many windows without the fault as a finding needs; the end; or a
    part that could not be judged."""
    # Deviating windows may hold a part of the fault, unless something else is reported for them.
    other = {i for one in runs if not one.brief for i in one.members}
    later = range(run.members.stop, len(found.judged))
    behind = [i for i in later if found.judged[i].lacks(fault)]
    gone = sum(not found.judged[i].deviating or i in other for i in behind)
    if gone >= limits.WINDOWS_IN_A_ROW:
        return ENDED
    if until >= max(float(piece.time[-1]) for piece in found.windows.pieces):
        return TO_THE_END
    return BRIEFLY_GONE if behind else UNJUDGED


def _readings(found: Weighed, one: Judged) -> Iterator[tuple[str, float]]:
    names = (*found.model.dynamics.inputs, *found.model.dynamics.outputs)
    for name, column in zip(names, (*one.window.inputs.T, *one.window.measured.T), strict=True):
        if np.isfinite(column).any():
            yield name, float(np.nanmedian(column))


def _not_judged(found: Weighed) -> list[Period]:
    """Windows that could not be judged, neighbours with the same reason joined."""
    periods: list[Period] = []
    there = np.any([piece.completeness > 0.0 for piece in found.windows.pieces], axis=0)
    before = ""
    for one in found.judged:
        because = one.window.because or "the balances have no solution here"
        if one.plain is not None:
            lacking = there & (one.window.completeness < limits.WINDOW_COMPLETE)
            blind = np.array(found.model.dynamics.outputs)[lacking].tolist()
            because = f"in part: {NO_READING.format(' and '.join(blind))}" if blind else ""
        since, until = float(one.window.time[0]), float(one.window.time[-1])
        if because and because == before:
            periods[-1] = replace(periods[-1], until=until)
        elif because:
            periods.append(Period(since, until, because, partly=one.plain is not None))
        before = because
    text = (
        f"fewer than {limits.FEWEST_IN_WINDOW} samples without a pause: "
        "balances need a window to be followed in"
    )
    return periods + [Period(*times, text) for times in found.windows.too_short]


def _notes(found: Weighed) -> Iterator[str]:
    windows, model = found.windows, found.model
    if windows.thinned > 1:
        yield f"{windows.thinned} samples at a time were averaged"
    measured = np.any([piece.completeness > 0.0 for piece in windows.pieces], axis=0)
    remarkable = measured & (found.misfit > limits.REMARKABLE_MISFIT * windows.noise)
    for i in np.flatnonzero(remarkable).tolist():
        signal = model.ruleset.signal_by_id[model.dynamics.outputs[i]]
        usual, noise = (x[i] / signal.factor for x in (found.misfit, windows.noise))
        slow = 1.0 / found.judge.share[i]
        lasts = f", alike for about {slow:.0f} samples" if slow > 1.0 else ""
        yield (
            f"{signal.id}: the balances usually miss this reading by {usual:.2g} {signal.unit}"
            f"{lasts} (its noise is {noise:.2g}); only what goes beyond counts"
        )
