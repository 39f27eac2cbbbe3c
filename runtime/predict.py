"""The recording that a plant should have made: what its model says of given readings.

Predicted is what the equations determine; everything else is taken as it was recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.equations import Equations, SimulationRefused, equations_of
from runtime.other_points import other_point
from runtime.plan import Array
from runtime.recording_file import RecordingFile
from runtime.rewrite import column_of
from runtime.ruleset import Ruleset, SignalSpec
from runtime.sensing import SensorErrors, sense
from runtime.simulate import Simulated, simulate_with

SHOWN = 5


@dataclass(frozen=True)
class Injected:
    """A fault that acts from one time of the recording to another, s."""

    fault: str
    degree: float
    since: float = -np.inf
    until: float = np.inf


@dataclass(frozen=True)
class Prediction:
    """What a model says of a recording of n rows.

    Attributes
    ----------
    given : signals that are taken from the recording.
    values : per predicted signal an array, shape (n,), SI; NaN where it is not predicted.
    whole : shape (n,), rows in which everything is predicted.
    notes : what the user should know.
    """

    given: tuple[str, ...]
    values: Mapping[str, Array]
    whole: np.ndarray
    notes: tuple[str, ...]


def predict(
    ruleset: Ruleset,
    files: Sequence[RecordingFile],
    injected: Sequence[Injected] = (),
    seed: int | None = None,
) -> Prediction:
    """Predict a recording of one or several files, row by row.

    Parameters
    ----------
    seed : of the sensors' errors; None for readings without errors.

    Raises
    ------
    SimulationRefused
        The plant cannot be simulated, a given reading has no column, or a fault is none of this
        plant.
    """
    equations = equations_of(ruleset)
    time = _times(files)
    recorded = _given(equations, files)
    given = {s.id: _running(s, recorded[s.id]) for s in equations.given_signals}
    degrees = _degrees(injected, time)
    simulated = simulate_with(equations, given, degrees)
    values = {name: simulated.values[name] for name in equations.predicted}
    notes = [
        *_left_out(equations, recorded, given, simulated),
        *_without_solution(simulated),
        *_beyond_sensors(equations, values),
        *_more_than_one(equations, given, degrees, simulated),
        *_as_recorded(ruleset, files),
    ]
    if seed is not None:
        gains = _gains(equations, given, degrees, simulated)
        random = np.random.default_rng(seed)
        values = sense(ruleset, values, SensorErrors(), random, gains)
    return Prediction(equations.given, values, simulated.solved, tuple(notes))


def _times(files: Sequence[RecordingFile]) -> Array:
    """Times of all rows, s; dates count from the first one."""
    time = np.concatenate([file.time for file in files])
    if any(file.dated for file in files) and np.isfinite(time).any():
        time = time - np.nanmin(time)
    return time


def _given(equations: Equations, files: Sequence[RecordingFile]) -> dict[str, Array]:
    """Given readings as recorded, shape (n,)."""
    for file in files:
        missing = [name for name in equations.given if name not in file.values]
        if missing:
            titles = [f"'{column_of(name, equations.ruleset)[0]}'" for name in missing]
            what = "columns" if len(titles) > 1 else "column"
            raise SimulationRefused(
                f"{file.path}: to predict the other readings of {equations.ruleset.plant}, it "
                f"needs the {what} {', '.join(titles)}"
            )
    return {n: np.concatenate([file.values[n] for file in files]) for n in equations.given}


def _running(signal: SignalSpec, recorded: Array) -> Array:
    """Readings, NaN where the equations do not hold, as the module stands."""
    if signal.minimum is None:
        return recorded
    return np.where(recorded < signal.minimum, np.nan, recorded)


def _degrees(injected: Sequence[Injected], time: Array) -> dict[str, Array | float]:
    """Degree of each fault; of several that overlap the last one counts."""
    degrees: dict[str, Array | float] = {}
    for part in injected:
        acts = np.isfinite(time) & (time >= part.since) & (time <= part.until)
        acts |= np.isinf(part.since) & np.isinf(part.until)
        if not acts.any():
            raise SimulationRefused(
                f"{part.fault} from {part.since:g} s to {part.until:g} s: the recording runs from "
                f"{np.nanmin(time):g} s to {np.nanmax(time):g} s"
            )
        degrees[part.fault] = np.where(acts, part.degree, degrees.get(part.fault, 0.0))
    return degrees


def _gains(
    equations: Equations,
    given: Mapping[str, Array],
    degrees: Mapping[str, Array | float],
    faulty: Simulated,
) -> dict[str, Array]:
    """Factors that faults in sensors put on predicted readings, errors and all."""
    known = equations.ruleset.fault_by_id
    sensors = {n: known[n].scales[0] for n in degrees if known[n].in_sensor}
    if not sensors:
        return {}
    others = {name: degree for name, degree in degrees.items() if name not in sensors}
    healthy = simulate_with(equations, given, others)
    wrong = set(sensors.values()) & set(equations.predicted)
    return {name: faulty.values[name] / healthy.values[name] for name in sorted(wrong)}


def _left_out(
    equations: Equations,
    recorded: Mapping[str, Array],
    given: Mapping[str, Array],
    simulated: Simulated,
) -> Iterator[str]:
    """Rows that are not predicted as something stands, or was not recorded."""
    for signal in equations.given_signals:
        blank = ~np.isfinite(recorded[signal.id])
        if blank.any():
            yield f"{_rows(blank)}: {signal.id} has no reading{_hangs(blank, simulated)}"
        stands = ~np.isfinite(given[signal.id]) & ~blank
        if stands.any() and signal.minimum is not None:
            limit = (signal.minimum - signal.offset) / signal.factor
            what = f"{signal.id} is below {limit:.3g} {signal.unit}"
            yield f"{_rows(stands)}: {what}{_hangs(stands, simulated)}"


def _hangs(rows: np.ndarray, simulated: Simulated) -> str:
    """What is not predicted in rows that lack something."""
    predicted = [v for name, v in simulated.flows.items() if np.isfinite(v[rows]).any()]
    return "; what hangs on it is not predicted" if predicted else "; they are not predicted"


def _rows(flags: np.ndarray) -> str:
    count, first = int(flags.sum()), int(np.argmax(flags)) + 1
    if count == len(flags):
        return f"all {count} rows"
    return f"{count} of {len(flags)} rows (the first is data row {first})"


def _without_solution(simulated: Simulated) -> Iterator[str]:
    failed = simulated.failed >= 0
    if failed.any():
        yield f"{_rows(failed)} have no solution: {simulated.why(int(np.argmax(failed)))}"


def _beyond_sensors(equations: Equations, values: Mapping[str, Array]) -> Iterator[str]:
    """Predicted readings that the sensor cannot show, or that diagnosis would not trust."""
    for name in equations.predicted:
        signal = equations.ruleset.signal_by_id[name]
        for limit, beyond, word in (
            (signal.lowest, values[name] < (signal.lowest or 0.0), "below its sensor's range"),
            (signal.highest, values[name] > (signal.highest or 0.0), "above its sensor's range"),
            (signal.minimum, values[name] < (signal.minimum or 0.0), "below its minimum"),
        ):
            if limit is not None and beyond.any():
                yield f"{_rows(beyond)}: {name} is predicted {word}"


def _more_than_one(
    equations: Equations,
    given: Mapping[str, Array],
    degrees: Mapping[str, Array | float],
    simulated: Simulated,
) -> Iterator[str]:
    other = other_point(equations, given, degrees, simulated)
    if other is not None:
        signal = equations.ruleset.signal_by_id[other.signal]
        here, there = (
            f"{(value - signal.offset) / signal.factor:.4g} {signal.unit}"
            for value in (other.predicted, other.also)
        )
        yield (
            f"more than one solution, as in data row {other.row + 1}: {signal.id} is predicted as "
            f"{here}, which follows from the reference point, but {there} would fit as well"
        )


def _as_recorded(ruleset: Ruleset, files: Sequence[RecordingFile]) -> Iterator[str]:
    """Signals that no equation reads, so that they may contradict what is predicted."""
    used = {name for observer in ruleset.observers for name in observer.signals}
    there = {name for file in files for name in file.values}
    names = [s.id for s in ruleset.signals if s.id in there and s.id not in used]
    if names:
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        yield f"no equation reads {', '.join(names[:SHOWN])}{more}: passed on as recorded"
