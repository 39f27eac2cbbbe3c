"""Readings of a plant that stores: its balances integrated over a recording.

Each file is a run of its own and begins at the start values of the ruleset, or at others. Readings
that follow from those of the same row are predicted as in plants that store nothing: before the
balances if these need them, else after.
"""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Dynamics, Ruleset
from rulec_runtime.limits import ABSURD, PAUSE
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.recordings.columns import filled
from rulec_runtime.recordings.recording_file import RecordingFile
from rulec_runtime.simulation.balances import Balances, RanAway

from rulec.simulation import limits
from rulec.simulation.equations import SimulationRefused, equations_of
from rulec.simulation.predict_settled import NOTHING, degrees_of, predict_settled, times_of
from rulec.simulation.prediction import (
    Injected,
    Prediction,
    beyond_ends,
    clipped_to_range,
    recorded_of,
    rows,
)

SHOWN = "shown:"
DEGREE = "x."
"""Prefix of a fault's degree among the inputs of the balances."""


def predict_stored(
    ruleset: Ruleset,
    dynamics: Dynamics,
    files: Sequence[RecordingFile],
    injected: Sequence[Injected] = (),
    starts: Sequence[Mapping[str, float]] = (),
) -> Prediction:
    """Predict all readings of a plant that stores.

    `starts` are values per file of the parameters from which states start, SI; by default as
    stated. Raises `SimulationRefused` if a given reading has no column, if a state grows without
    bound, or if the plant or its balances have no such fault.
    """
    _check_faults(ruleset, dynamics, injected)
    if refused := ruleset.simulation.refused:
        return _stored(ruleset, dynamics, files, injected, NOTHING, (refused,), starts=starts)
    settled = equations_of(ruleset)
    if not settled.predicted:
        return _stored(ruleset, dynamics, files, injected, NOTHING, starts=starts)
    before = sorted(set(dynamics.inputs).intersection(settled.predicted))
    behind = sorted(set(settled.given).intersection(dynamics.outputs))
    if before and behind:
        raise SimulationRefused(
            f"{ruleset.plant} cannot be simulated: its balances need {', '.join(before)}, which "
            f"follows from {', '.join(behind)} at the same moment, and that from the balances"
        )
    # The settled equations do not know faults that act only on what is stored.
    at_once = [part for part in injected if ruleset.fault_by_id[part.fault].affects]
    if before:
        first = predict_settled(settled, files, at_once)
        computed = {name: first.values[name] for name in before}
        return _joined(first, _stored(ruleset, dynamics, files, injected, computed, starts=starts))
    first = _stored(ruleset, dynamics, files, injected, NOTHING, all_of=behind, starts=starts)
    computed = clipped_to_range(ruleset, {n: first.values[n] for n in behind}, behind)
    return _joined(first, predict_settled(settled, files, at_once, computed))


def _check_faults(ruleset: Ruleset, dynamics: Dynamics, injected: Sequence[Injected]) -> None:
    """Refuse faults that the plant does not have, and those that its balances should know."""
    for name in (part.fault for part in injected):
        fault = ruleset.fault_by_id.get(name)
        if fault is None:
            hint = did_you_mean(name, ruleset.fault_by_id)
            raise SimulationRefused(f"{ruleset.plant} has no fault '{name}'; {hint}")
        read = {s for o in fault.affects for s in ruleset.observer_by_id[o].signals}
        if read.intersection(dynamics.inputs) and name not in dynamics.faults:
            raise SimulationRefused(
                f"{name} changes a flow into a module with storage; balances with it are not known"
            )


def _joined(first: Prediction, second: Prediction) -> Prediction:
    values = {**first.values, **second.values}
    given = dict.fromkeys((*first.given, *second.given))
    return Prediction(
        given=tuple(name for name in given if name not in values),
        values=values,
        whole=np.asarray(np.isfinite(list(values.values())).all(axis=0)),
        notes=(*first.notes, *second.notes),
        gains={**first.gains, **second.gains},
        limited=(*first.limited, *second.limited),
    )


def _stored(
    ruleset: Ruleset,
    dynamics: Dynamics,
    files: Sequence[RecordingFile],
    injected: Sequence[Injected],
    computed: Mapping[str, Array],
    notes: tuple[str, ...] = (),
    all_of: Sequence[str] = (),
    starts: Sequence[Mapping[str, float]] = (),
) -> Prediction:
    """Readings of states; `computed` are inputs that other equations predict."""
    names = tuple(n for n in dynamics.outputs if n in (*all_of, *_asked(ruleset, dynamics, files)))
    faulty = [part for part in injected if part.fault in dynamics.faults]
    courses = degrees_of(faulty, times_of(files)) if faulty else {}
    degrees = {f"{DEGREE}{name}": np.asarray(course) for name, course in courses.items()}
    every = (*dynamics.inputs, *degrees)
    balances = Balances(
        dynamics.plan,
        tuple(state.id for state in dynamics.states),
        every,
        tuple(f"{SHOWN}{name}" for name in names),
    )
    given = [name for name in dynamics.inputs if name not in computed]
    inputs = {**recorded_of(ruleset, files, given), **computed, **degrees}
    signals = ruleset.signal_by_id
    held = np.array([n in degrees or signals[n].between == "hold" for n in every], bool)
    found, remarks, first = [], list(notes), 0
    for file, start in zip(files, starts or [dict[str, float]() for _ in files], strict=True):
        last = first + len(file.time)
        part, values = {n: inputs[n][first:last] for n in every}, {**dynamics.values, **start}
        try:
            found.append(_course(balances, file, part, held, values, remarks))
        except RanAway:
            raise SimulationRefused(
                f"{file.path}: a state of {ruleset.plant} grows beyond all bounds; check the "
                "values of its modules, and the unit of the given columns"
            ) from None
        first = last
    shown = np.concatenate(found)
    predicted = {name: shown[:, i] for i, name in enumerate(names)}
    remarks += _beyond_sensors(ruleset, predicted)
    whole = np.asarray(np.isfinite(shown).all(axis=1))
    return Prediction(
        given=tuple(given), values=predicted, whole=whole, notes=tuple(remarks), limited=names
    )


def _asked(ruleset: Ruleset, dynamics: Dynamics, files: Sequence[RecordingFile]) -> set[str]:
    """Readings to predict: those that some file has or the column map knows.

    A module type may have more sensors than are installed, and only a column map says which are.
    Without one, or if no state has a reading, all are predicted.
    """
    there = {name for file in files for name in file.values}
    fitted = there.union(column.signal for column in ruleset.columns)
    asked = fitted.intersection(dynamics.outputs)
    return asked if ruleset.columns and asked else set(dynamics.outputs)


def _beyond_sensors(ruleset: Ruleset, values: Mapping[str, Array]) -> Iterator[str]:
    """Notes on readings that their sensors show as an end of their range."""
    for name, value in values.items():
        signal = ruleset.signal_by_id[name]
        for beyond, word, end in beyond_ends(signal, value):
            yield (
                f"{rows(beyond)}: {name} would be {word} its sensor's range, which then shows "
                f"{signal.shown(end):.4g} {signal.unit}"
            )


def _course(
    balances: Balances,
    file: RecordingFile,
    inputs: Mapping[str, Array],
    held: NDArray[np.bool_],
    values: Mapping[str, float],
    notes: list[str],
) -> Array:
    """Outputs of balances over the n rows of a file, shape (n, outputs).

    Rows are put in order of time; those without a time are NaN. Inputs, shape (n,), SI, keep their
    value where they are missing, and until the next sample if they are `held`. Raises
    `SimulationRefused` if no row has a time, or if an input has no reading, and `RanAway` if a
    state grows without bound.
    """
    has_time = np.isfinite(file.time) & (np.abs(file.time) < ABSURD)
    if not has_time.any():
        raise SimulationRefused(f"{file.path}: no row has a usable time")
    timed = np.flatnonzero(has_time)
    order = timed[np.argsort(file.time[timed], kind="stable")]
    time = file.time[order] - file.time[order[0]]
    notes += (f"{file.path.name}: {note}" for note in _odd_times(has_time, order, time))
    for name, given in inputs.items():
        if not np.isfinite(given[order]).any():
            raise SimulationRefused(f"{file.path}: {name} has not one reading")
        blank = ~np.isfinite(given)
        if blank.any():
            what = f"{rows(blank)}: {name} has no reading; the last one counts on"
            notes.append(f"{file.path.name}: {what}")
    whole = np.array([filled(given[order]) for given in inputs.values()])
    full, own = _bridged(time)
    last = np.searchsorted(own, np.arange(len(full)), side="right") - 1
    between = whole.reshape(len(inputs), len(time))[:, last].T.copy()
    for j in np.flatnonzero(~held):
        between[:, j] = np.interp(full, time, whole[j])
        between[own, j] = whole[j]
    result = np.full((len(file.time), len(balances.outputs)), np.nan)
    result[order] = balances.run(full, between, held, values).shown[own]
    return result


def _odd_times(has_time: NDArray[np.bool_], order: NDArray[np.intp], time: Array) -> Iterator[str]:
    if not has_time.all():
        yield f"{rows(~has_time)} have no usable time; they are not predicted"
    if np.any(np.diff(order) < 0):
        yield "the rows are not in order of time; they are predicted in it"
    wide = _gaps(time)
    if wide.any():
        longest, count = float(np.diff(time)[wide].max()), int(wide.sum())
        where = f"behind data row {order[int(np.argmax(wide))] + 1}"
        what = f"a gap of {longest:.4g} s {where}"
        if count > 1:
            what = f"{count} gaps of up to {longest:.4g} s, the first {where}"
        yield f"{what}: integrated across"


def _gaps(time: Array) -> NDArray[np.bool_]:
    """Flags of pauses much longer than the sampling interval, shape (n - 1,)."""
    steps = np.diff(time)
    return steps > PAUSE * _interval(steps)


def _interval(steps: Array) -> float:
    return float(np.median(steps[steps > 0])) if np.any(steps > 0) else np.inf


def _bridged(time: Array) -> tuple[Array, NDArray[np.intp]]:
    """Times with extra samples in gaps, and the indices of the rows among them."""
    wide, interval = np.flatnonzero(_gaps(time)), _interval(np.diff(time))
    parts = [
        np.linspace(a, b, min(int((b - a) / interval), limits.GAP_STEPS) + 1)[1:-1]
        for a, b in zip(time[wide], time[wide + 1], strict=True)
    ]
    counts = [len(part) for part in parts]
    shift = np.zeros(len(time), dtype=int)
    shift[wide + 1] = counts
    between = np.concatenate([np.empty(0), *parts])
    return np.insert(time, np.repeat(wide + 1, counts), between), np.arange(
        len(time)
    ) + shift.cumsum()
