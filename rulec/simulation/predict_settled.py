"""Readings at the operating points of a plant that stores nothing, row by row."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.limits import COVERAGE
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.recording_file import RecordingFile
from rulec_runtime.recordings.stationary import systematic_u

from rulec.simulation import limits
from rulec.simulation.equations import Equations, SimulationRefused
from rulec.simulation.prediction import Injected, Prediction, beyond_ends, recorded_of, rows
from rulec.simulation.simulate import Simulated, simulate_with

NOTHING: Mapping[str, Array] = {}


def predict_settled(
    equations: Equations,
    files: Sequence[RecordingFile],
    injected: Sequence[Injected] = (),
    computed: Mapping[str, Array] = NOTHING,
) -> Prediction:
    """Predict the readings that follow from others of the same row.

    `computed` readings, shape (n,), SI, replace recorded ones. Raises `SimulationRefused` if a
    given reading has no column, or if the plant has no such fault.
    """
    time = times_of(files)
    asked = [name for name in equations.given if name not in computed]
    recorded = {**computed, **recorded_of(equations.ruleset, files, asked)}
    running = dict(recorded)
    for s in equations.given_signals:
        if s.minimum is not None:  # below it the module is stopped, and the equations do not hold
            running[s.id] = np.where(recorded[s.id] < s.minimum, np.nan, recorded[s.id])
    given = {
        s.id: nearly_shut(s, running[s.id], equations.ruleset) for s in equations.given_signals
    }
    degrees = degrees_of(injected, time)
    simulated = simulate_with(equations, given, degrees)
    values = {name: simulated.values[name] for name in equations.predicted}
    notes = (
        *_left_out(equations, recorded, running, simulated),
        *_beyond_sensors(equations, values),
    )
    return Prediction(
        given=equations.given,
        values=values,
        whole=simulated.solved,
        notes=notes,
        gains=_gains(equations, given, degrees, simulated),
    )


def times_of(files: Sequence[RecordingFile]) -> Array:
    """Times of all rows, s; dates count from the first one."""
    time = np.concatenate([file.time for file in files])
    if any(file.dated for file in files) and np.isfinite(time).any():
        time = time - np.nanmin(time)
    return time


def degrees_of(injected: Sequence[Injected], time: Array) -> dict[str, Array | float]:
    """Degree of each fault; if periods overlap, the last one counts."""
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
    """Factors by which faults in sensors scale predicted readings, with their errors."""
    faults = equations.ruleset.fault_by_id
    # An offset of a reading does not change the errors of its sensor.
    scaling = (n for n in degrees if faults[n].in_sensor and not faults[n].unit)
    sensors = {n: faults[n].scales[0] for n in scaling}
    if not sensors:
        return {}
    others = {name: degree for name, degree in degrees.items() if name not in sensors}
    healthy = simulate_with(equations, given, others)
    wrong = set(sensors.values()) & set(equations.predicted)
    return {name: faulty.values[name] / healthy.values[name] for name in sorted(wrong)}


def _left_out(
    equations: Equations,
    recorded: Mapping[str, Array],
    running: Mapping[str, Array],
    simulated: Simulated,
) -> Iterator[str]:
    """Notes on rows that are not predicted, or only at the smallest flow."""
    for signal in equations.given_signals:
        blank = ~np.isfinite(recorded[signal.id])
        if blank.any():
            yield f"{rows(blank)}: {signal.id} has no reading{_consequence(blank, simulated)}"
        stopped = ~np.isfinite(running[signal.id]) & ~blank
        if stopped.any() and signal.minimum is not None:
            what = f"{signal.id} is below {signal.shown(signal.minimum):.3g} {signal.unit}"
            yield f"{rows(stopped)}: {what}{_consequence(stopped, simulated)}"
    for signal in equations.given_signals:
        shut = without_flow(signal, running[signal.id], equations.ruleset) & simulated.solved
        if shut.any():
            yield f"{rows(shut)}: {signal.id} shows no flow; predicted at next to none"
    failed = simulated.failed >= 0
    if failed.any():
        yield f"{rows(failed)} have no solution: {simulated.why(int(np.argmax(failed)))}"


def _consequence(rows: np.ndarray, simulated: Simulated) -> str:
    predicted = [v for name, v in simulated.flows.items() if np.isfinite(v[rows]).any()]
    return "; what hangs on it is not predicted" if predicted else "; they are not predicted"


def _beyond_sensors(equations: Equations, values: Mapping[str, Array]) -> Iterator[str]:
    """Notes on predicted readings that the sensor cannot show, or that diagnosis would not use."""
    for name in equations.predicted:
        signal = equations.ruleset.signal_by_id[name]
        for beyond, word, _ in beyond_ends(signal, values[name]):
            yield f"{rows(beyond)}: {name} is predicted {word} its sensor's range"
        if signal.minimum is not None and (below := values[name] < signal.minimum).any():
            yield f"{rows(below)}: {name} is predicted below its minimum"


# Operation against a closed valve. Many estimates of a flow are that flow times a ratio that is 1
# without faults. At a flow of exactly zero they reduce to 0 = 0 and determine no reading. Its limit
# exists, and is what the plant does there. Readings are therefore predicted at a flow so small that
# no meter shows it.

VOLUME_FLOW = (3.0, 0.0, -1.0, 0.0, 0.0)
"""Exponents of m, kg, s, K, A."""


def is_flow(signal: SignalSpec, ruleset: Ruleset) -> bool:
    """Whether a reading is a volume flow."""
    own = parse_unit(signal.unit, ruleset.units)
    return own is not None and own.dimension == VOLUME_FLOW


def without_flow(signal: SignalSpec, values: Array, ruleset: Ruleset) -> np.ndarray:
    """Flags of readings of a flow meter that show no flow, shape (n,); `values` are SI."""
    if not is_flow(signal, ruleset):
        return np.zeros(len(values), dtype=bool)
    tiny = limits.NO_FLOW * abs(signal.reference)
    zero = np.maximum(COVERAGE * systematic_u(signal, values), tiny)
    with np.errstate(invalid="ignore"):
        none: np.ndarray = (values < tiny) & (values >= -zero)
    return none


def nearly_shut(signal: SignalSpec, values: Array, ruleset: Ruleset) -> Array:
    """Readings in which the smallest flow replaces a flow of zero."""
    tiny = limits.NO_FLOW * abs(signal.reference)
    nearly: Array = np.where(without_flow(signal, values, ruleset), tiny, values)
    return nearly
