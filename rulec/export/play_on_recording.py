"""Play the controllers on a recording: the results of exported code for each settled window.

They serve to check a controller when a module is put into service, and to try a central part before
there is a controller.
"""

from collections.abc import Callable, Iterable, Mapping
from math import isfinite

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.steady.evaluated_points import judgeable
from rulec_runtime.diagnosis.steady.points import Points, points_of_stretches
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.recordings.module_results import KINDS
from rulec_runtime.recordings.recording import Recording, RecordingRefused
from rulec_runtime.recordings.stationary import Stretches

from rulec.export.program import ModuleCode, Routine, Value, run

Execute = Callable[[Routine, Mapping[str, Value]], Mapping[str, Value]]
"""Runs a routine: from its inputs by name to its outputs by name."""


def played(
    recording: Recording, ruleset: Ruleset, codes: Iterable[ModuleCode], execute: Execute = run
) -> dict[str, Array]:
    """Results of all modules: an array per column of the results file, with an entry per window.

    Raises `RecordingRefused` if the plant never settles.
    """
    sound = examine(recording, ruleset).recording
    stretches, noise = judgeable(sound, ruleset, "default")
    if not len(stretches):
        raise RecordingRefused("nothing to play: the recording holds no settled window")
    routines = [r for code in codes for r in code.routines if r.name == "observe"]
    whole = points_of_stretches(sound, ruleset, stretches, noise)
    since = sound.time[stretches.first]
    columns = {
        "time [s]": since,
        "seconds": sound.time[stretches.last - 1] - since,
        "samples": stretches.lengths.astype(float),
    }
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
        results, early, late = (
            observed(routine, ruleset, part, len(stretches), execute) for part in (whole, *halves)
        )
        for name, values in results.items():
            if name.partition(":")[0] in KINDS:
                columns.setdefault(name, values)
            if name.startswith("q:"):
                flag = name.replace("q:", "known:", 1)
                both = np.logical_and(early[flag], late[flag])
                apart = np.where(both, late[name] - early[name], np.nan)
                columns[name.replace("q:", "apart:", 1)] = apart
    return columns


def observed(
    routine: Routine, ruleset: Ruleset, points: Points, n: int, execute: Execute
) -> dict[str, Value]:
    """Outputs of a routine at n operating points by id, each of shape (n,)."""
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
    """Standard uncertainty of a mean by noise, shape (n,), in the unit of the reading."""
    if name not in points.values:
        return np.full(n, np.nan)
    part: Array = points.statistical(name) / abs(ruleset.signal_by_id[name].factor)
    return part


def results_csv(columns: Mapping[str, Array]) -> str:
    """Results as CSV; numbers with all their digits, an empty cell for a missing one."""
    lines = [row_of(columns)]
    for row in zip(*(np.asarray(c, dtype=float).tolist() for c in columns.values()), strict=True):
        lines.append(",".join(repr(value) if isfinite(value) else "" for value in row))
    return "\n".join(lines) + "\n"
