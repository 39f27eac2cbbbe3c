"""How well every sample agrees, including those in which a settled plant changes its state.

A column with a wrong clock agrees while everything is constant, and contradicts the others around
each change: in samples that the search for physics leaves out. Liquids follow within milliseconds,
so apart from lags every sample is an operating point of its own.

Source: own derivation.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.points import points_of_samples
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import Stretches

from rulec.mismatch.evidence.samples import ESTIMATION
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import Data
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.structure import limits


@dataclass(frozen=True)
class Moving:
    """Samples of a recording, judged by a model that was fitted to its settled points.

    `chosen`, shape (n,), are numbers of samples: all, or evenly spaced ones.
    """

    recording: Recording
    rows: Rows
    setting: Configuration
    chosen: NDArray[np.intp]

    @cached_property
    def recorded(self) -> Array:
        """Errors as recorded, shape (rows,), in units of their noise."""
        return self.errors({})

    def errors(self, columns: Mapping[str, Array]) -> Array:
        """Errors with some columns replaced, each shape (samples of the recording,), SI."""
        at = {name: values[self.chosen] for name, values in columns.items()}
        return self.rows.errors(self.rows.system.flows(self.setting, at=at))[0]

    @cached_property
    def slopes(self) -> dict[str, Array]:
        """Slopes of errors by each reading, shape (rows,), per SI."""
        flows = self.rows.system.flows(self.setting)
        maps = self.rows.maps(flows)
        return {name: self.rows.column(maps, by) for name, by in flows.by_reading.items()}

    def excess(self, errors: Array) -> Array:
        """Log of a sample's deviation in noise, shape (n,); NaN if nothing is compared."""
        square, count = (
            np.bincount(self.rows.point, values, minlength=len(self.chosen))
            for values in (errors**2, np.ones(len(errors)))
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            log: Array = 0.5 * np.log(np.maximum(square / count, 1.0))
        return log


def moving_of(
    recording: Recording, data: Data, system: System, setting: Configuration
) -> Moving | None:
    """Samples of a recording in addition to its settled points; None if nothing checks them."""
    n = len(recording)
    chosen = np.arange(0, n, -(-n // limits.MOVING_SAMPLES))
    lengths = np.sqrt(data.stretches.lengths)
    noise = {name: float(np.median(v * lengths)) for name, v in data.noise.items()}
    samples = Data(
        points=points_of_samples(recording, system.ruleset, noise).at(chosen),
        time=recording.time[chosen],
        noise={k: np.full(len(chosen), v) for k, v in noise.items()},
        block=np.zeros(len(chosen), dtype=np.intp),
        part=np.full(len(chosen), ESTIMATION),
        of_rows=False,
        split="",
        digest="",
        moving={},
        stretches=Stretches(chosen, chosen + 1),
        sample=np.zeros(0, dtype=np.intp),
        source=np.zeros(len(chosen), np.intp)
        if recording.source is None
        else recording.source[chosen],
        sources=recording.sources,
        clock=recording.time[chosen] - recording.time[0],
        timed=True,
    )
    rows = rows_of(System(system.ruleset, system.builder, samples), setting)
    return Moving(recording, rows, setting, chosen) if rows.groups else None
