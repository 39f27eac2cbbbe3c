"""The recording that a plant should have made: what its model says of given readings.

Predicted is what the equations determine; everything else is taken as it was recorded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording_file import RecordingFile

from rulec.simulation.equations import SimulationRefused, equations_of
from rulec.simulation.predict_settled import predict_settled
from rulec.simulation.prediction import Injected, Prediction, within_range
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

    Parameters
    ----------
    seed : of the sensors' errors; None for readings without errors.
    starts : per file values of parameters from which states start, SI; as stated without.

    Raises
    ------
    SimulationRefused
        The plant cannot be simulated, a given reading has no column, or a fault is none of this
        plant.
    """
    exact = _exact(ruleset, files, injected, starts)
    values = exact.values
    if seed is not None:
        random = np.random.default_rng(seed)
        values = sense(ruleset, values, SensorErrors(), random, exact.gains)
    values = within_range(ruleset, values, exact.limited)
    notes = (*exact.notes, *_as_recorded(ruleset, files))
    return replace(exact, values=values, notes=notes)


def _exact(
    ruleset: Ruleset,
    files: Sequence[RecordingFile],
    injected: Sequence[Injected],
    starts: Sequence[Mapping[str, float]],
) -> Prediction:
    """What perfect sensors would show."""
    if ruleset.dynamics is None:
        equations = equations_of(ruleset)
        if not equations.predicted:
            raise SimulationRefused(
                f"{ruleset.plant}: no equation determines a reading, so there is nothing to "
                "predict; a second estimate of a flow, or a module that stores, would"
            )
        return predict_settled(equations, files, injected)
    # The integrator's compiler is loaded only for plants that store.
    from rulec.simulation.predict_stores import predict_stored

    return predict_stored(ruleset, ruleset.dynamics, files, injected, starts)


def _as_recorded(ruleset: Ruleset, files: Sequence[RecordingFile]) -> Iterator[str]:
    """Signals that no equation reads, so that they may contradict what is predicted."""
    there = {name for file in files for name in file.values}
    names = [s.id for s in ruleset.signals if s.id in there and s.id not in ruleset.read]
    if names:
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        yield f"no equation reads {', '.join(names[:SHOWN])}{more}: passed on as recorded"
