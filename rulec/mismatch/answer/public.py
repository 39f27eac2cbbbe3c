"""Errors as anybody finds them: plants that were written, compiled and simulated.

The analysis knows errors of sensors, faults and courses in time that no plant file holds. What it
tells of a model must be what `rulec simulate` gives with the plant that is written, so it is
measured that way: shipped, recalibrated and repaired plant alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.header import Header
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.recording_file import RecordingFile
from rulec_runtime.report.text import number

from rulec.effects.adopted_plant import trial
from rulec.effects.candidate import Unwritable
from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch.answer import limits
from rulec.mismatch.answer.verdict import is_spoiled
from rulec.mismatch.evidence.samples import inside_of
from rulec.mismatch.inference.prove import rms
from rulec.mismatch.result import Check, Fit, Repair
from rulec.simulation.equations import SimulationRefused
from rulec.simulation.predict import predict


@dataclass(frozen=True)
class Plants:
    """Readings by the shipped, the recalibrated and the repaired plant, per row of the recording.

    Each is a table by signal, shape (rows,), SI; the last is None where it cannot be written or
    simulated, which `refused` tells.
    """

    shipped: Mapping[str, Array]
    recalibrated: Mapping[str, Array]
    repaired: Mapping[str, Array] | None
    rulesets: tuple[Ruleset, Ruleset, Ruleset]
    refused: str = ""

    @property
    def signals(self) -> tuple[str, ...]:
        """What all of them predict."""
        return tuple(n for n in self.shipped if n in self.recalibrated and n in self.last)

    @property
    def last(self) -> Mapping[str, Array]:
        """Readings by the repaired plant, else by the recalibrated one, shape (rows,), SI."""
        return self.recalibrated if self.repaired is None else self.repaired


def simulated(ruleset: Ruleset, recording: Recording) -> Mapping[str, Array]:
    """Readings by `rulec simulate`, per signal, shape (rows,), SI; raises `SimulationRefused`."""
    return predict(ruleset, _files(recording)).values


def plants_of(
    ruleset: Ruleset, builder: ModelBuilder, recording: Recording, plain: Repair, repair: Repair
) -> Plants:
    """Write, compile and simulate; raises `SimulationRefused` where the plant cannot be simulated.

    Raises `Unwritable` where not even other values can be written.
    """
    first = simulated(ruleset, recording)
    recalibrated = trial(builder, plain)
    second = simulated(recalibrated, recording)
    if not repair.joined:
        return Plants(first, second, second, (ruleset, recalibrated, recalibrated))
    try:
        repaired = trial(builder, repair)
        third = simulated(repaired, recording)
    except (Unwritable, SimulationRefused) as error:
        return Plants(first, second, None, (ruleset, recalibrated, recalibrated), str(error))
    return Plants(first, second, third, (ruleset, recalibrated, repaired))


def refusal(
    verdict: str,
    fits: Sequence[Fit],
    joined: Sequence[str],
    unwritten: str,
    checks: Sequence[Check] = (),
    instead: bool = True,
) -> str:
    """Why the repaired plant is not to be written; empty if it may.

    `instead` tells whether recalibration alone would do: its values may be nobody's to believe.
    Then the repair must be better than the plant as shipped, and no worse beyond chance than what
    those values give.

    Held-out blocks decide nothing but this. The first reading must be met better beyond chance
    where errors are told, and not worse over all held-out rows, those in periods of faults too: a
    fault may be none. No other reading may be met worse beyond chance.
    """
    if verdict == "ambiguous" and joined:
        return "the recording does not tell which of several explanations is right"
    if unwritten:
        return f"it cannot be written: {unwritten}"
    for i, fit in enumerate(fits if joined else ()):
        held, which = fit.heldout, "held-out"
        if not held.points:
            held, which = fit.estimation, "fitted"
        plain = held.recalibrated if instead or i else held.shipped
        worse = held.repaired > plain * (1.0 + limits.SAME_ERROR)
        if (i == 0 and worse) or is_spoiled(fit):
            return _worse(fit, held.repaired, held.recalibrated, f"on {which} samples")
        if i == 0 and fit.gain_interval[0] <= 0.0 and instead:
            low, high = (number(100.0 * share) for share in fit.gain_interval)
            return (
                f"simulated with it, the error of {fit.signal} on held-out samples falls by {low} "
                f"to {high} % (95 %) beside recalibrated values alone, which may be chance"
            )
    for check in checks if joined and instead else ():
        if check.signal == fits[0].signal and check.error > check.plain * (1.0 + limits.SAME_ERROR):
            return _worse(fits[0], check.error, check.plain, "over all held-out rows")
    return ""


def _worse(fit: Fit, own: float, plain: float, where: str) -> str:
    unit = "" if fit.unit == "1" else f" {fit.unit}"
    return (
        f"simulated with it, {fit.signal} is off by {number(own)}{unit} {where}, and by "
        f"{number(plain)}{unit} with recalibrated values alone"
    )


def checks_of(
    plants: Plants, recording: Recording, spans: Sequence[tuple[float, float]]
) -> tuple[Check, ...]:
    """What `rulec adopt` must find again: see `row_errors`."""
    ruleset = plants.rulesets[0]
    plain = row_errors(ruleset, plants.recalibrated, recording, spans)
    own = row_errors(ruleset, plants.last, recording, spans)
    both = (n for n in own if n in plain)
    return tuple(
        Check(signal=n, rows=own[n][1], error=own[n][0], plain=plain[n][0])
        for n in both
        if own[n][1]
    )


def row_errors(
    ruleset: Ruleset,
    predicted: Mapping[str, Array],
    recording: Recording,
    spans: Sequence[tuple[float, float]],
) -> dict[str, tuple[float, int]]:
    """Error of each predicted reading, as shown, over rows of spans, and how many those are.

    Rows count that have a reading and a prediction; not those in which the reading is below its
    minimum, as the equations do not hold there. `predicted` has shape (rows,) per signal, SI;
    `spans` are in s.
    """
    inside = inside_of(recording.time, spans)
    found = {}
    for name, course in predicted.items():
        if name in recording.values:
            signal, measured = ruleset.signal_by_id[name], recording.values[name]
            low = -np.inf if signal.minimum is None else signal.minimum
            off = (course - measured)[inside & (measured >= low)] / signal.factor
            off = off[np.isfinite(off)]
            found[name] = (rms(off), len(off))
    return found


def _files(recording: Recording) -> list[RecordingFile]:
    """The recording as the files that it was read from."""
    found = []
    for segment in dict.fromkeys(recording.segment.tolist()):
        rows = recording.segment == segment
        values = {name: v[rows] for name, v in recording.values.items()}
        found.append(file_of(f"file {int(segment) + 1}", recording.time[rows], values))
    return found


def file_of(name: str, time: Array, values: dict[str, Array]) -> RecordingFile:
    """Readings, SI, at times, s, shape (n,) each, as a file of that name would hold them."""
    return RecordingFile(
        path=Path(name), header=Header(), time=time, values=values, zones=None, comma=False
    )
