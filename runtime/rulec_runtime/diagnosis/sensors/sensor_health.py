"""Sensor health before physics: which readings of a recording are invalid, and why.

Each reading is first checked by itself (range, noise, clock), then against what the others predict.
A column that does not match its header is read as what it is. Other invalid readings become NaN, so
that the rest is judged without them.
"""

from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors import limits
from rulec_runtime.diagnosis.sensors.agreement import check_of
from rulec_runtime.diagnosis.sensors.conditions import (
    CLOCK,
    RANGE,
    REPEATED,
    SATURATED,
    Found,
    SensorFinding,
    found_in,
    stuck_in,
)
from rulec_runtime.diagnosis.sensors.dead import at_zero, dead_readings
from rulec_runtime.diagnosis.sensors.frozen import frozen_readings
from rulec_runtime.diagnosis.sensors.headers import Misread, misread_columns
from rulec_runtime.output.plural import plural
from rulec_runtime.recordings import limits as recorded
from rulec_runtime.recordings.columns import median_of, runs_where
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.header_correction import mended as read_by
from rulec_runtime.recordings.larger_than_memory import copied
from rulec_runtime.recordings.plant_calendar import ENDED, TO_THE_END, duration
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import never_moves, standing_still
from rulec_runtime.recordings.stationary import systematic_u

NOT_STUCK: Mapping[str, float] = {}

WHY = {
    "dead": "dead at zero",
    "stuck": "stuck at one value",
    "range": "outside the sensor's range",
    "saturated": "at the end of the sensor's range",
}
"""By name of a condition: why a reading is not used, in a few words."""


@dataclass(frozen=True)
class Health:
    """Invalid readings, and the recording without them, its columns read by `mendings`."""

    findings: tuple[SensorFinding, ...]
    recording: Recording
    mendings: tuple[Mending, ...] = ()


def examine(
    recording: Recording,
    ruleset: Ruleset,
    *,
    by_model: bool = True,
    headers: bool = True,
    mended: Set[str] = frozenset(),
    stuck_since: Mapping[str, float] = NOT_STUCK,
) -> Health:
    """Judge the sensors of a recording.

    `by_model` also compares readings with the ruleset's predictions; a plant not yet calibrated, or
    whose model is in doubt, predicts nothing. Without `headers` columns are trusted to match their
    headers, as are those already `mended`. `stuck_since` are the times since which readings are
    known to be stuck, s, from rows before this recording.
    """
    if recording.unfit is not None:
        return Health((), recording)
    found, below_end = [*_out_of_range(recording, ruleset)], recording
    if by_model and ruleset.dynamics is None:  # windows leave out the ends of a range themselves
        saturated = [*_saturated(recording, ruleset)]
        found, below_end = found + saturated, without(recording, saturated)
    clean = without(recording, found)
    stuck = [*_stuck_readings(clean, ruleset, stuck_since)]
    found, clean = found + stuck, without(clean, stuck)
    still = mended | {finding.signal for finding, _ in stuck}
    misread = _misread_of(below_end, clean, ruleset, still) if by_model and headers else None
    if by_model and not misread:
        check = None if ruleset.dynamics else check_of(clean, ruleset)
        dead = [] if check is None else [*dead_readings(clean, ruleset, check)]
        found, clean = found + dead, without(clean, dead)
        if dead and headers:
            misread = _misread_of(below_end, clean, ruleset, still)
    if misread:
        # Once mended, a column may be in its range, and may reveal errors of others.
        return _as_mended(recording, ruleset, misread, mended)
    if by_model and any(map(never_moves, clean.values.values())):
        frozen = [*_frozen_of(clean, ruleset)]
        found, clean = found + frozen, without(clean, frozen)
    end = recording.time[-1]
    findings = (replace(f, behind=TO_THE_END if f.until >= end else ENDED) for f, _ in found)
    return Health(_in_order([*findings, *_clock(recording)]), clean)


def _as_mended(
    recording: Recording, ruleset: Ruleset, misread: Misread, before: Set[str]
) -> Health:
    rest = examine(
        read_by(recording, misread.mendings), ruleset, mended={*before, *misread.signals}
    )
    since, until = float(recording.time[0]), float(recording.time[-1])
    found = (
        SensorFinding(
            condition=misread.condition,
            signal=signal,
            since=since,
            until=until,
            text=text,
            behind=TO_THE_END,
            mended=misread.mended,
        )
        for signal, text in zip(misread.signals, misread.texts, strict=True)
    )
    findings = _in_order([*found, *rest.findings])
    return Health(findings, rest.recording, (*misread.mendings, *rest.mendings))


def _in_order(findings: Iterable[SensorFinding]) -> tuple[SensorFinding, ...]:
    return tuple(sorted(findings, key=lambda f: ("FC".index(f.condition.status), f.since, f.id)))


def _out_of_range(recording: Recording, ruleset: Ruleset) -> Iterable[Found]:
    """Readings that their sensor cannot show.

    Source: NAMUR NE 43: a signal of 4 to 20 mA measures from 3.8 to 20.5 mA; at most 3.6 or at
    least 21 mA signal a failure of the device. So a reading more than 2.5 % of its range below the
    live zero, or 6.25 % above its end, is invalid.
    """
    for signal in ruleset.signals:
        values, (low, high) = recording.values.get(signal.id), signal.ends
        if values is None or not np.isfinite(high - low):
            continue
        below, above = (
            share * (high - low) for share in (limits.FAILED_BELOW, limits.FAILED_ABOVE)
        )
        with np.errstate(invalid="ignore"):
            failed = (values <= low - below) | (values >= high + above)
        for a, b in runs_where(failed, common.PERSISTENCE):
            usual = median_of(values[a:b])
            shown, *ends = (f"{signal.shown(v):.4g}" for v in (usual, low, high))
            side = "below its live zero" if usual < low else "above its range"
            text = (
                f"{signal.id} reads {shown} {signal.unit}, {side} "
                f"({' to '.join(ends)} {signal.unit}), so it is not a valid reading"
            )
            yield found_in(recording, slice(a, b), RANGE, signal.id, text)


def _saturated(recording: Recording, ruleset: Ruleset) -> Iterable[Found]:
    """Readings that stand at the upper end of their range, or above it where the sensor still
    measures: the true value may be larger. An input may be set to its highest value.

    Source: NAMUR NE 43: above 20 mA a transmitter follows to 20.5 mA at most, and stays there.
    """
    for signal in ruleset.signals:
        values, (low, high) = recording.values.get(signal.id), signal.ends
        if values is None or signal.is_input or not np.isfinite(high - low):
            continue
        span = high - low
        with np.errstate(invalid="ignore"):
            at_end = np.abs(values - high) <= recorded.SAME_LEVEL * span
            above = values > high + common.BEYOND_RANGE * span
            valid = values < high + limits.FAILED_ABOVE * span
            at_end |= above & valid
            beyond = at_end | ((values > high) & valid)  # noise interrupts no run
        for a, b in runs_where(beyond, common.PERSISTENCE):
            if not runs_where(at_end[a:b], common.PERSISTENCE):
                continue
            usual = median_of(values[a:b])
            shown, *ends = (f"{signal.shown(v):.4g}" for v in (usual, low, high))
            text = (
                f"{signal.id} stands at {shown} {signal.unit}, at the end of its range "
                f"({' to '.join(ends)} {signal.unit}): the true value may be larger"
            )
            yield found_in(recording, slice(a, b), SATURATED, signal.id, text)


def _stuck_readings(
    recording: Recording, ruleset: Ruleset, stuck_since: Mapping[str, float]
) -> Iterable[Found]:
    """Readings that lose their noise. Inputs are mostly set values: they must have some first.

    Those known to be stuck remain so, if the noise before is no longer in the recording.
    """
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or not np.isfinite(values).any():
            continue
        u = np.inf
        if signal.is_input:
            u = median_of(systematic_u(signal, values) + np.zeros(len(values)))
        # Below the minimum the module is at standstill, and the reading is not used.
        low = signal.lowest if signal.minimum is None else signal.minimum
        runs = standing_still(values, u, (low, signal.highest))
        if signal.id in stuck_since and not runs:
            runs = _still_stuck(
                values, int(np.searchsorted(recording.time, stuck_since[signal.id]))
            )
        for a, b in runs:
            if at_zero(signal, values[a : a + 1])[0]:
                continue  # a clipped zero; the others decide whether it is dead
            yield stuck_in(recording, slice(a, b), signal, "even its noise is gone")


def _still_stuck(values: Array, first: int) -> list[tuple[int, int]]:
    """The run of equal readings from a row on, if too few others are left to show its noise."""
    finite = np.isfinite(values)
    moved = np.flatnonzero(finite[first:] & (values[first:] != values[first : first + 1]))
    behind = first + int(moved[0]) if len(moved) else len(values)
    others = finite[:first].sum() + finite[behind:].sum()
    long = behind - first >= common.PERSISTENCE
    return [(first, behind)] if long and others < 2 * recorded.STILL_RUN else []


def without(recording: Recording, found: Iterable[Found]) -> Recording:
    """The recording without these readings; the same one if nothing was found."""
    found = list(found)
    if not found and recording.unfit is not None:
        return recording
    values: dict[str, Array] = dict(recording.values)
    unfit: dict[str, str] = dict(recording.unfit or {})
    for finding, part in found:
        if finding.signal:
            column = copied(values[finding.signal])
            column[part] = np.nan
            values[finding.signal] = column
            before = unfit.get(finding.signal, "").split(" or ")
            reasons = dict.fromkeys([*filter(None, before), WHY[finding.condition.name]])
            unfit[finding.signal] = " or ".join(reasons)
    return replace(recording, values=values, unfit=unfit)


def _clock(recording: Recording) -> Iterable[SensorFinding]:
    for one in recording.clock:
        what = CLOCK
        text = f"the clock was set back by {duration(one.seconds)}: times were written twice"
        if one.rows:
            what, shared = REPEATED, plural(one.times, "time", "times")
            text = f"{one.rows} rows have only {shared}: the clock stood, or seconds are missing"
        yield SensorFinding(condition=what, signal="", since=one.time, until=one.time, text=text)


def _frozen_of(recording: Recording, ruleset: Ruleset) -> Iterable[Found]:
    """Readings that never move though the others show that they should."""
    if ruleset.dynamics is not None:
        # The integrator takes a second to load, and only plants that store need it.
        from rulec_runtime.diagnosis.sensors.stores import silent_readings

        return silent_readings(recording, ruleset)
    check = check_of(recording, ruleset)
    return () if check is None else frozen_readings(recording, ruleset, check)


def _misread_of(
    recording: Recording, clean: Recording, ruleset: Ruleset, still: Set[str]
) -> Misread | None:
    """Columns that do not match their headers, other than constant ones."""
    check = None if ruleset.dynamics else check_of(clean, ruleset)
    constant = {name for name, values in clean.values.items() if never_moves(values)}
    return None if check is None else misread_columns(recording, check, still | constant)
