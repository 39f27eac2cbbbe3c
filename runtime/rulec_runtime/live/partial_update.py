"""A partial update: judges only the parts of a plant whose readings moved.

The verdicts on the other parts, the noise of readings and the findings about sensors stay until the
next full update.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import assembled, joined
from rulec_runtime.diagnosis.steady.evaluated_points import evaluate_points
from rulec_runtime.diagnosis.steady.evidence import Latest, latest_of
from rulec_runtime.diagnosis.steady.findings import Found
from rulec_runtime.diagnosis.steady.growing_faults import found_of
from rulec_runtime.live.full_update import unsettled
from rulec_runtime.live.history import History, history_of, only
from rulec_runtime.live.history import joined as joined_history
from rulec_runtime.live.last_evaluation import LastEvaluation, PartEvaluation, due_after
from rulec_runtime.live.memory import Memory
from rulec_runtime.recordings.header_correction import mended
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.slow_motion import settle_or_slow_by


def partial_update(
    ruleset: Ruleset, memory: Memory, known: LastEvaluation, moved: Collection[int]
) -> LastEvaluation:
    """The evaluation after some parts, by their indices, were judged again."""
    parts, levels = list(known.parts), known.levels
    latest = known.diagnosis.latest
    settled = settled_until(parts)
    for place in moved:
        parts[place], whole, residuals = _judged(memory, known, parts[place])
        if len(whole):
            latest = _replaced(ruleset, latest, residuals)
            levels = levels.judged(whole)
    now = settled_until(parts)
    each = [
        one.found if place in moved else _going_on(one.found, settled, now)
        for place, one in enumerate(parts)
    ]
    parts = [replace(one, found=found) for one, found in zip(parts, each, strict=True)]
    diagnosis = assembled(
        known.health,
        ruleset,
        "default",
        judged=known.diagnosis.judged,
        found=replace(joined(each, latest), regimes=known.diagnosis.regimes),
        # Active blind periods continue: a reading that goes or comes causes a full update.
        blind=tuple(
            replace(b, until=float(memory.recent.time[-1])) if b.active else b
            for b in known.diagnosis.blind
        ),
    )
    return replace(known, diagnosis=diagnosis, parts=tuple(parts), levels=levels)


def settled_until(parts: Sequence[PartEvaluation]) -> float:
    """Time of the last settled row of any part, s."""
    return max(one.settled for one in parts)


def _judged(
    memory: Memory, known: LastEvaluation, one: PartEvaluation
) -> tuple[PartEvaluation, History, Latest | None]:
    """The evaluation of a part, its operating points, and the residuals at the last of them."""
    own, count = one.part.ruleset, memory.count
    rows = _rows_of(own, memory, known)
    noise = {name: known.noise[name] for name in rows.values}
    stretches = settle_or_slow_by(rows, own, noise)
    whole = history_of(rows, own, stretches, noise)
    if memory.before is not None:
        whole = joined_history(only(memory.before, one.part), rows, whole)
    if not len(whole):
        found = Found([], [], [])
        return replace(one, found=found, due=due_after(whole, count)), whole, None
    evaluated = evaluate_points(own, whole.points, whole.halves, "default")
    found = joined((found_of(whole.timeline, own, part) for part in evaluated), None)
    found.not_judged.extend(unsettled(rows, whole))
    again = replace(
        one,
        found=found,
        settled=float(whole.timeline.until[-1]),
        due=due_after(whole, count),
    )
    return again, whole, latest_of(own, whole.timeline, evaluated)


def _rows_of(own: Ruleset, memory: Memory, known: LastEvaluation) -> Recording:
    """The rows in memory of the signals of a part, without readings found unfit."""
    clean, recent = known.health.recording, mended(memory.recent, known.health.mendings)
    unfit = {f.signal for f in known.health.findings if f.active and not f.mended}
    examined = len(recent) - (memory.count - known.count)
    values = {}
    for name in sorted(own.observed & recent.values.keys() & clean.values.keys()):
        column = recent.values[name].copy()
        column[:examined] = clean.values[name][len(clean) - examined :]
        if name in unfit:
            column[examined:] = np.nan
        values[name] = column
    return replace(recent, values=values, unfit=clean.unfit)


def _going_on(found: Found, settled: float, now: float) -> Found:
    """The findings of a part that was not updated: periods up to the last settled row continue."""
    unknown, blind = (
        [replace(p, until=now) if p.until >= settled else p for p in periods]
        for periods in (found.unknown, found.not_judged)
    )
    return Found(found.findings, unknown, blind)


def _replaced(ruleset: Ruleset, before: Latest | None, new: Latest | None) -> Latest | None:
    if before is None or new is None:
        return new or before
    found = {e.residual: e for e in (*before.residuals, *new.residuals)}
    ordered = tuple(found[r.id] for r in ruleset.residuals if r.id in found)
    return Latest(new.since, new.until, ordered)
