"""Sensors that fail to read now and then: single readings that neither neighbour bears out.

No law of a plant makes a reading jump away for one sample and come back. So this is told before any
physics, for every signal of the recording, whether an equation reads it or not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from runtime.mismatch.result import Finding
from runtime.plan import Array
from runtime.recording import Recording
from runtime.ruleset import Ruleset, SignalSpec

FAR = 8.0
"""A single reading that is so many times the usual step away from both neighbours is none."""

OFTEN, MANY = 0.005, 20
"""Share of all readings, and number, from which such readings are the sensor's fault."""

SURE = 0.99
"""Nothing else does this [assumed]."""


def glitches_in(values: Array) -> np.ndarray:
    """Flags of single readings that neither neighbour bears out, shape (n,)."""
    step = np.abs(np.diff(values))
    usual = 1.4826 * float(np.nanmedian(step)) if np.isfinite(step).any() else 0.0
    usual = max(usual, 1e-12 + 0.02 * float(np.nanstd(values)))
    odd = np.zeros(len(values), dtype=bool)
    before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
    with np.errstate(invalid="ignore"):
        odd[1:-1] = (before * after > 0) & (np.minimum(abs(before), abs(after)) > FAR * usual)
    return odd


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
