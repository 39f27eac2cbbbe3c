"""The recording that a plant should have made, by its model and given readings.

The model predicts what its equations determine; everything else stays as recorded.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording_file import RecordingFile

from rulec.simulation.equations import SimulationRefused, equations_of
from rulec.simulation.predict_settled import predict_settled
from rulec.simulation.prediction import Injected, Prediction, clipped_to_range
from rulec.simulation.sensing import SensorErrors, sense

SHOWN = 5


def predict(
    ruleset: Ruleset,
    files: Sequence[RecordingFile],
    injected: Sequence[Injected] = (),
    seed: int | None = None,
    starts: Sequence[Mapping[str, float]] = (),
) -> Prediction:
    """Predict a recording of one or several files, row by row.

    `seed` is that of the sensor errors, None for readings without errors; `starts` are values per
    file of the parameters from which states start, SI, by default as stated. Raises
    `SimulationRefused` if the plant cannot be simulated, if a given reading has no column, or if
    the plant has no such fault.
    """
    if ruleset.dynamics is None:
        equations = equations_of(ruleset)
        if not equations.predicted:
            raise SimulationRefused(
                f"{ruleset.plant}: no equation determines a reading, so there is nothing to "
                "predict; add a second estimate of a flow, or a module with storage"
            )
        exact = predict_settled(equations, files, injected)
    else:
        # Only plants that store need the compiler of the integrator.
        from rulec.simulation.predict_stores import predict_stored

        exact = predict_stored(ruleset, ruleset.dynamics, files, injected, starts)
    values = exact.values
    if seed is not None:
        random = np.random.default_rng(seed)
        values = sense(ruleset, values, SensorErrors(), random, exact.gains)
    values = clipped_to_range(ruleset, values, exact.limited)
    notes = (*exact.notes, *_as_recorded(ruleset, files))
    return replace(exact, values=values, notes=notes)


def _as_recorded(ruleset: Ruleset, files: Sequence[RecordingFile]) -> Iterator[str]:
    """A note on signals that no equation reads, as they may contradict the prediction."""
    there = {name for file in files for name in file.values}
    names = [s.id for s in ruleset.signals if s.id in there and s.id not in ruleset.read]
    if names:
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        yield f"not used by any equation, copied unchanged: {', '.join(names[:SHOWN])}{more}"
