"""Sensors that fail to read now and then: single readings that neither neighbour bears out.

No law of a plant makes a reading jump away for one sample and come back. So this is told before any
physics, for every signal of the recording, whether an equation reads it or not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from runtime.dynamic.thin import glitches_in
from runtime.mismatch.result import Finding
from runtime.plan import Array
from runtime.recording import Recording
from runtime.ruleset import Ruleset, SignalSpec

OFTEN, MANY = 0.005, 20
"""Share of all readings, and number, from which such readings are the sensor's fault."""

SURE = 0.99
"""Nothing else does this [assumed]."""


def failing(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Sensors that fail often, each as a finding."""
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or len(values) < MANY or not np.isfinite(values).any():
            continue
        odd = glitches_in(values)
        if odd.sum() >= max(MANY, OFTEN * len(values)):
            yield _finding(signal, values, odd)


def _finding(signal: SignalSpec, values: Array, odd: np.ndarray) -> Finding:
    module, _, place = signal.id.partition(".")
    away = float(np.median(np.abs(values[odd] - values[np.flatnonzero(odd) - 1]))) / signal.factor
    share = 100.0 * float(odd.mean())
    return Finding(
        f"{signal.id}.drop-outs",
        "sensor",
        "drop-outs",
        "Sensor that drops out",
        module,
        place,
        {},
        "",
        f"{signal.id} drops out: {int(odd.sum())} single readings ({share:.1f} %) jump away by "
        f"about {away:.3g} {signal.unit} and back; they are left out",
        "check cable, mounting and supply of the sensor",
        "",
        SURE,
        (),
        0.0,
        (),
        (),
        0.0,
    )
