"""One file as input of the integrator: in order of time, without missing inputs or wide gaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.limits import ABSURD, PAUSE
from rulec_runtime.recordings.recording_file import RecordingFile
from rulec_runtime.recordings.thin import filled
from rulec_runtime.simulation.balances import Balances

from rulec.simulation import limits
from rulec.simulation.equations import SimulationRefused
from rulec.simulation.prediction import rows


@dataclass(frozen=True)
class Run:
    """n rows of a file, of which some have a time.

    Attributes
    ----------
    count : n.
    order : the rows with a time, in order of time.
    time : shape (rows in order,), s, from 0 on.
    inputs : shape (rows in order, inputs), SI, finite.
    held : per input, whether it keeps its value until the next sample.
    """

    count: int
    order: NDArray[np.intp]
    time: Array
    inputs: Array
    held: NDArray[np.bool_]


def run_of(
    file: RecordingFile, inputs: Mapping[str, Array], held: NDArray[np.bool_], notes: list[str]
) -> Run:
    """Put the rows of a file in order of time, and hold inputs where they are missing.

    Raises `SimulationRefused` if no row has a time, or if an input has no reading.
    """
    has_time = np.isfinite(file.time) & (np.abs(file.time) < ABSURD)
    if not has_time.any():
        raise SimulationRefused(f"{file.path}: no row has a usable time")
    kept = np.flatnonzero(has_time)
    order = kept[np.argsort(file.time[kept], kind="stable")]
    time = file.time[order] - file.time[order[0]]
    notes += (f"{file.path.name}: {note}" for note in _odd_times(has_time, order, time))
    for name, values in inputs.items():
        if not np.isfinite(values[order]).any():
            raise SimulationRefused(f"{file.path}: {name} has not one reading")
        blank = ~np.isfinite(values)
        if blank.any():
            notes.append(
                f"{file.path.name}: {rows(blank)}: {name} has no reading; the last one counts on"
            )
    columns = [filled(values[order]) for values in inputs.values()]
    whole = np.column_stack(columns) if columns else np.empty((len(order), 0))
    return Run(len(file.time), order, time, whole, held)


def course(balances: Balances, run: Run, values: Mapping[str, float]) -> Array:
    """Outputs of balances over a run, shape (rows, outputs); NaN in rows without a time.

    Raises `RanAway` if a state grows without bound.
    """
    time, inputs, own = _bridged(run)
    found = balances.run(time, inputs, run.held, values)
    result = np.full((run.count, len(balances.outputs)), np.nan)
    result[run.order] = found.shown[own]
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


def _bridged(run: Run) -> tuple[Array, Array, NDArray[np.intp]]:
    """Times and inputs with extra samples in gaps, and the indices of the rows among them."""
    time, wide = run.time, np.flatnonzero(_gaps(run.time))
    interval = _interval(np.diff(time))
    parts = [
        np.linspace(a, b, min(int((b - a) / interval), limits.GAP_STEPS) + 1)[1:-1]
        for a, b in zip(time[wide], time[wide + 1], strict=True)
    ]
    own = np.arange(len(time)) + np.repeat(
        np.cumsum([0, *map(len, parts)]), np.diff([0, *(wide + 1), len(time)])
    )
    between = np.concatenate([np.empty(0), *parts])
    full = np.insert(time, np.repeat(wide + 1, [len(p) for p in parts]), between)
    last = np.searchsorted(own, np.arange(len(full)), side="right") - 1
    inputs = run.inputs[last]
    for j in np.flatnonzero(~run.held):
        inputs[:, j] = np.interp(full, time, run.inputs[:, j])
        inputs[own, j] = run.inputs[:, j]
    return full, inputs, own
