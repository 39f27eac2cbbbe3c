"""Events shorter than a settled stretch: counted, and pooled.

Samples between settled stretches are left out, as a plant in transition does not obey steady laws.
If the plant is sound on both sides of such a gap, at the same settings, there was no transition:
something came and went. Each such event is a point of its own, judged beside the sound stretches as
if it were a stretch; what they all have in common is reported. A single sample of a single reading
is a glitch, and no event.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints, evaluate_part
from rulec_runtime.diagnosis.steady.findings import Events, Finding, findings_of
from rulec_runtime.diagnosis.steady.points import (
    Points,
    one_after_the_other,
    points_of_samples,
    points_of_stretches,
)
from rulec_runtime.diagnosis.steady.redundancy import has_many, thinned
from rulec_runtime.recordings.plant_calendar import ENDED
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches, Timeline, systematic_u, timeline_of

Gaps = np.ndarray
"""Samples left out between two stretches, first and last (excluded), and the place of the stretch
before: shape (gaps, 3)."""


def events_of(
    recording: Recording,
    ruleset: Ruleset,
    stretches: Stretches,
    noise: Mapping[str, float],
    evaluated: list[EvaluatedPoints],
    mode: str,
    earlier: int = 0,
) -> Iterator[Finding]:
    """One finding per intermittent fault; `earlier` points came before the first stretch."""
    gaps = _without_reason(recording, ruleset, stretches, noise)
    gaps[:, 2] += earlier
    if len(gaps) < limits.FEWEST_EVENTS or not all(part.combined for part in evaluated):
        return
    samples = np.concatenate([np.arange(a, b) for a, b, _ in gaps])
    alone = points_of_samples(recording, ruleset, noise).at(samples)
    for part in evaluated:
        if has_many(part.part.ruleset):
            continue
        both, before = _beside_sound(ruleset, part, alone, mode)
        off = np.zeros(len(recording), dtype=bool)
        off[samples] = both.isolation.deviating[before:]
        events = _events(gaps, part, off)
        if len(events) >= limits.FEWEST_EVENTS:
            yield from _pooled(recording, ruleset, events, noise, part, mode)


def _without_reason(
    recording: Recording, ruleset: Ruleset, stretches: Stretches, noise: Mapping[str, float]
) -> Gaps:
    """Short gaps in which no setting changed, during the gap or across it."""
    first, last = stretches.last[:-1], stretches.first[1:]
    short = np.flatnonzero((last > first) & (last - first <= limits.LONGEST_EVENT))
    gaps = np.column_stack([first[short], last[short], short])
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if signal.is_input and values is not None:
            still = [_steady(signal, values[a - 1 : b + 1], noise[signal.id]) for a, b, _ in gaps]
            gaps = gaps[np.array(still, dtype=bool)]
    return gaps


def _steady(signal: SignalSpec, values: np.ndarray, noise: float) -> bool:
    level = float(np.median(values))
    floor = common.NO_CHANGE * float(systematic_u(signal, level))
    limit = max(common.JUMP * np.sqrt(2.0) * noise, floor)
    return bool(np.ptp(values) <= limit)


def _events(gaps: Gaps, evaluated: EvaluatedPoints, off: np.ndarray) -> Gaps:
    """Samples that deviate, in gaps between sound stretches of a part of the plant."""
    sound = evaluated.isolation.judged & ~evaluated.isolation.deviating
    found = []
    for a, b, before in gaps:
        there = np.flatnonzero(off[a:b])
        if len(there) and sound[before] and sound[before + 1]:
            found.append((a + there[0], a + there[-1] + 1, before))
    return np.array(found, dtype=np.intp).reshape(-1, 3)


def _pooled(
    recording: Recording,
    ruleset: Ruleset,
    events: Gaps,
    noise: Mapping[str, float],
    evaluated: EvaluatedPoints,
    mode: str,
) -> Iterator[Finding]:
    """Findings by all events of a part of a plant together, beside its sound stretches."""
    spans = Stretches(events[:, 0], events[:, 1])
    own = points_of_stretches(recording, ruleset, spans, noise)
    both, before = _beside_sound(ruleset, evaluated, own, mode)
    times = timeline_of(recording.time, spans)
    # All sound stretches came before.
    earlier = np.full(before, times.since[0] - 1.0)
    timeline = Timeline(
        since=np.concatenate([earlier, times.since]),
        until=np.concatenate([earlier, times.until]),
        samples=np.concatenate([np.full(before, common.PERSISTENCE), times.samples]),
        later=np.concatenate([np.full(before, times.later[0]), times.later]),
        paused=np.zeros(before + len(times), dtype=bool),
    )
    for finding in findings_of(timeline, ruleset, both).findings:
        there = np.flatnonzero((times.since >= finding.since) & (times.until <= finding.until))
        summary = _summary(recording, ruleset, events[there], own.at(there))
        glitch = finding.fault.in_sensor and summary.samples < limits.LEAST_EVENT * summary.count
        if summary.count >= limits.FEWEST_EVENTS and not glitch and finding.behind is not ENDED:
            yield replace(
                finding, events=summary, text=f"{finding.text}; {summary.text}", behind=ENDED
            )


def _beside_sound(
    ruleset: Ruleset, evaluated: EvaluatedPoints, own: Points, mode: str
) -> tuple[EvaluatedPoints, int]:
    """Events, which are too short for lags, judged behind sound stretches of a part of the plant,
    and the number of these."""
    sound = np.flatnonzero(evaluated.isolation.judged & ~evaluated.isolation.deviating)
    some = evaluated.points.at(thinned(sound, common.STRETCHES_LOOKED_AT))
    both = one_after_the_other([some, replace(own, lag={})])
    return evaluate_part(ruleset, evaluated.part, both, mode), len(both) - len(own)


def _summary(recording: Recording, ruleset: Ruleset, events: Gaps, points: Points) -> Events:
    samples = int((events[:, 1] - events[:, 0]).sum())
    interval = float(recording.interval)
    whole = float(recording.time[-1] - recording.time[0]) + interval
    inputs = {
        s.id: (float(np.nanmin(values)), float(np.nanmax(values)))
        for s in ruleset.signals
        if s.is_input and len(values := points.values.get(s.id, np.zeros(0)))
    }
    return Events(
        count=len(events),
        samples=samples,
        duration=interval * samples / max(len(events), 1),
        share=interval * samples / whole,
        settings=inputs,
    )
