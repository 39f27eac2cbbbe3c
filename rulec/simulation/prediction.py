"""The prediction of a model for a recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording_file import RecordingFile

from rulec.simulation.equations import SimulationRefused
from rulec.simulation.rewrite import column_of


@dataclass(frozen=True)
class Injected:
    """A fault that acts from one time of the recording to another, s."""

    fault: str
    degree: float
    since: float = -np.inf
    until: float = np.inf


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """The prediction for a recording of n rows; before `sense`, with perfect sensors.

    Attributes
    ----------
    given : signals taken from the recording.
    values : an array per predicted signal, shape (n,), SI; NaN where it is not predicted.
    whole : shape (n,), rows in which everything is predicted.
    notes : remarks for the user.
    gains : factors, shape (n,), by which faults in sensors scale predictions and their errors.
    limited : signals limited to the ranges of their sensors.
    """

    given: tuple[str, ...]
    values: Mapping[str, Array]
    whole: np.ndarray
    notes: tuple[str, ...]
    gains: Mapping[str, Array] = field(default_factory=dict)
    limited: tuple[str, ...] = ()


def recorded_of(
    ruleset: Ruleset, files: Sequence[RecordingFile], names: Iterable[str]
) -> dict[str, Array]:
    """Readings as recorded, shape (n,); raises `SimulationRefused` if a file lacks a column."""
    wanted = list(names)
    for file in files:
        missing = [name for name in wanted if name not in file.values]
        if missing:
            titles = [f"'{column_of(name, ruleset)[0]}'" for name in missing]
            what = "columns" if len(titles) > 1 else "column"
            raise SimulationRefused(
                f"{file.path}: to predict the other readings of {ruleset.plant}, it "
                f"needs the {what} {', '.join(titles)}"
            )
    return {n: np.concatenate([file.values[n] for file in files]) for n in wanted}


def within_range(
    ruleset: Ruleset, values: Mapping[str, Array], names: Iterable[str]
) -> dict[str, Array]:
    """Readings, those of the signals in `names` limited to the ranges of their sensors."""
    result = dict(values)
    for name in names:
        result[name] = np.clip(result[name], *ruleset.signal_by_id[name].ends)
    return result


def beyond_ends(signal: SignalSpec, values: Array) -> Iterator[tuple[np.ndarray, str, float]]:
    """Where readings leave the range of their sensor: flags, side, and end of the range, SI."""
    low, high = signal.ends
    for beyond, word, end in ((values < low, "below", low), (values > high, "above", high)):
        if beyond.any():
            yield beyond, word, end


def rows(flags: np.ndarray) -> str:
    """The number of flagged rows and the first of them, in words."""
    count, first = int(flags.sum()), int(np.argmax(flags)) + 1
    if count == len(flags):
        return f"all {count} rows"
    return f"{count} of {len(flags)} rows (the first is data row {first})"
