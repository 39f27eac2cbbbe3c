"""Sensor health before physics: which readings of a recording are invalid, and why.

Each reading is first checked by itself (range, noise, clock), then against what the others predict.
A column that does not match its header is read as what it is. Other invalid readings become NaN, so
that the rest is judged without them.
"""

from collections.abc import Iterable, Set
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.agreement import bench_of
from rulec_runtime.diagnosis.sensors.conditions import CLOCK, Found, SensorFinding, stuck_in
from rulec_runtime.diagnosis.sensors.dead import at_zero, dead_readings
from rulec_runtime.diagnosis.sensors.frozen import frozen_readings
from rulec_runtime.diagnosis.sensors.headers import Misread, misread_columns
from rulec_runtime.diagnosis.sensors.ranges import out_of_range
from rulec_runtime.recordings.columns import median_of
from rulec_runtime.recordings.header_correction import Mending
from rulec_runtime.recordings.header_correction import mended as read_by
from rulec_runtime.recordings.larger_than_memory import kept
from rulec_runtime.recordings.plant_calendar import ENDED, TO_THE_END, duration
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import never_moves, standing_still
from rulec_runtime.recordings.stationary import systematic_u

WHY = {"dead": "dead at zero", "stuck": "stuck at one value", "range": "outside the sensor's range"}
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
) -> Health:
    """Judge the sensors of a recording.

    `by_model` also compares readings with the ruleset's predictions; a plant not yet calibrated, or
    whose model is in doubt, predicts nothing. Without `headers` columns are trusted to match their
    headers, as are those already `mended`.
    """
    if recording.unfit is not None:
        return Health((), recording)
    found = [*out_of_range(recording, ruleset)]
    clean = without(recording, found)
    stuck = [*stuck_readings(clean, ruleset)]
    found, clean = found + stuck, without(clean, stuck)
    misread = None
    if by_model and headers:
        misread = misread_of(recording, clean, ruleset, _still(stuck, clean) | mended)
    if by_model and not misread:
        dead = dead_of(clean, ruleset)
        found, clean = found + dead, without(clean, dead)
        if dead and headers:
            misread = misread_of(recording, clean, ruleset, _still(stuck, clean) | mended)
    if misread:
        # Once mended, a column may be in its range, and may reveal errors of others.
        return _as_mended(recording, ruleset, misread, mended)
    if by_model:
        frozen = frozen_of(clean, ruleset)
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


def _still(stuck: Iterable[Found], recording: Recording) -> set[str]:
    still = {finding.signal for finding, _ in stuck}
    return still | {name for name, values in recording.values.items() if never_moves(values)}


def stuck_readings(recording: Recording, ruleset: Ruleset) -> Iterable[Found]:
    """Readings that lose their noise. Inputs are mostly set values: they must have some first."""
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or not np.isfinite(values).any():
            continue
        u = np.inf
        if signal.is_input:
            u = median_of(systematic_u(signal, values) + np.zeros(len(values)))
        # Below the minimum the module is at standstill, and the reading is not used.
        low = signal.lowest if signal.minimum is None else signal.minimum
        for a, b in standing_still(values, u, (low, signal.highest)):
            if at_zero(signal, values[a : a + 1])[0]:
                continue  # a clipped zero; the others decide whether it is dead
            yield stuck_in(recording, slice(a, b), signal, "even its noise is gone")


def without(recording: Recording, found: Iterable[Found]) -> Recording:
    """The recording without these readings; the same one if nothing was found."""
    found = list(found)
    if not found and recording.unfit is not None:
        return recording
    values: dict[str, Array] = dict(recording.values)
    unfit: dict[str, str] = dict(recording.unfit or {})
    for finding, part in found:
        if finding.signal:
            column = kept(values[finding.signal])
            column[part] = np.nan
            values[finding.signal] = column
            before = unfit.get(finding.signal, "").split(" or ")
            reasons = dict.fromkeys([*filter(None, before), WHY[finding.condition.name]])
            unfit[finding.signal] = " or ".join(reasons)
    return replace(recording, values=values, unfit=unfit)


def _clock(recording: Recording) -> list[SensorFinding]:
    found = []
    for one in recording.clock:
        text = f"the clock was set back by {duration(one.seconds)}: times were written twice"
        if one.rows:
            text = f"the clock stood still for {one.rows} rows: they have one and the same time"
        found.append(
            SensorFinding(condition=CLOCK, signal="", since=one.time, until=one.time, text=text)
        )
    return found


def dead_of(recording: Recording, ruleset: Ruleset) -> list[Found]:
    """Readings that are dead, by what the others predict."""
    if ruleset.dynamics is not None:
        return []
    bench = bench_of(recording, ruleset)
    return [] if bench is None else [*dead_readings(recording, ruleset, bench)]


def frozen_of(recording: Recording, ruleset: Ruleset) -> list[Found]:
    """Readings that never move though the others show that they should."""
    if not any(map(never_moves, recording.values.values())):
        return []
    if ruleset.dynamics is not None:
        # The integrator takes a second to load, and only plants that store need it.
        from rulec_runtime.diagnosis.sensors.stores import silent_readings

        return [*silent_readings(recording, ruleset)]
    bench = bench_of(recording, ruleset)
    return [] if bench is None else [*frozen_readings(recording, ruleset, bench)]


def misread_of(
    recording: Recording, clean: Recording, ruleset: Ruleset, still: Set[str]
) -> Misread | None:
    """Columns that do not match their headers, other than constant ones."""
    if ruleset.dynamics is not None:
        return None
    bench = bench_of(clean, ruleset)
    return None if bench is None else misread_columns(recording, bench, still)
