"""Play the controllers on a recording: what exported code says of each settled window.

Whoever puts a module into service compares its controller with this, and a central part can be
tried before there is any.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from math import isfinite

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.evaluated_points import judgeable
from rulec_runtime.diagnosis.steady.points import Points, points_of_stretches
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.recordings.module_results import KINDS
from rulec_runtime.recordings.recording import Recording, RecordingRefused
from rulec_runtime.recordings.stationary import Stretches

from rulec.export.interpret import Value, run
from rulec.export.program import ModuleCode, Routine

OBSERVE = "observe"


Execute = Callable[[Routine, Mapping[str, Value]], Mapping[str, Value]]
"""Runs a routine: its outputs by name, of its inputs by name."""


def played(
    recording: Recording,
    ruleset: Ruleset,
    codes: Iterable[ModuleCode],
    execute: Execute = run,
) -> dict[str, Array]:
    """Results of all modules: per column of the results file an array, one entry per window.

    Raises `RecordingRefused` where the plant never settles.
    """
    sound = examine(recording, ruleset).recording
    stretches, noise = judgeable(sound, ruleset, "default")
    if not len(stretches):
        raise RecordingRefused("nothing to play: the recording holds no settled window")
    routines = [r for code in codes for r in code.routines if r.name == OBSERVE]
    whole = points_of_stretches(sound, ruleset, stretches, noise)
    columns = dict(_windows(sound, stretches))
    columns |= {
        f"{s.id} [{s.unit}]": s.shown(whole.values[s.id])
        for s in ruleset.signals
        if s.id in whole.values and s.id in ruleset.observed
    }
    columns |= {f"lag:{name}": errors for name, errors in whole.lag.items()}
    for signal in ruleset.signals:
        if signal.id in ruleset.observed:
            columns[f"noise:{signal.id}"] = _noise(ruleset, whole, signal.id, len(stretches))
    middle = stretches.first + stretches.lengths // 2
    halves = [
        points_of_stretches(sound, ruleset, part, noise)
        for part in (Stretches(stretches.first, middle), Stretches(middle, stretches.last))
    ]
    for routine in routines:
        said, early, late = (
            observed(routine, ruleset, part, len(stretches), execute) for part in (whole, *halves)
        )
        for name, values in said.items():
            if name.partition(":")[0] in KINDS:
                columns.setdefault(name, values)
            if name.startswith("q:"):
                known = name.replace("q:", "known:", 1)
                both = np.logical_and(early[known], late[known])
                apart = np.where(both, late[name] - early[name], np.nan)
                columns[name.replace("q:", "apart:", 1)] = apart
    return columns


def observed(
    routine: Routine, ruleset: Ruleset, points: Points, n: int, execute: Execute
) -> dict[str, Value]:
    """What a routine says of operating points, by id of its outputs, each of shape (n,)."""
    values: dict[str, Value] = {}
    for variable in routine.inputs:
        kind, _, name = variable.id.rpartition(":")
        signal = ruleset.signal_by_id[name]
        reading = signal.shown(points.values.get(name, np.full(n, np.nan)))
        if kind == "good":
            values[variable.name] = np.isfinite(reading)
        elif kind == "noise":
            values[variable.name] = _noise(ruleset, points, name, n)
        else:
            values[variable.name] = reading
    outputs = execute(routine, values)
    return {
        v.id: np.broadcast_to(np.asarray(outputs[v.name], dtype=float), (n,))
        for v in routine.outputs
    }


def _noise(ruleset: Ruleset, points: Points, name: str, n: int) -> Array:
    """Standard uncertainty of a mean by noise, in the unit of the reading."""
    if name not in points.values:
        return np.full(n, np.nan)
    part: Array = points.statistical(name) / abs(ruleset.signal_by_id[name].factor)
    return part


def _windows(recording: Recording, stretches: Stretches) -> Iterator[tuple[str, Array]]:
    since = recording.time[stretches.first]
    yield "time [s]", since
    yield "seconds", recording.time[stretches.last - 1] - since
    yield "samples", stretches.lengths.astype(float)


def results_csv(columns: Mapping[str, Array]) -> str:
    """Results as a file; numbers with all their digits, an empty cell where there is none."""
    lines = [row_of(columns)]
    for row in zip(*(np.asarray(c, dtype=float).tolist() for c in columns.values()), strict=True):
        lines.append(",".join(repr(value) if isfinite(value) else "" for value in row))
    return "\n".join(lines) + "\n"
