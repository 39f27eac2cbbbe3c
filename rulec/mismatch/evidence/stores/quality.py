"""Sensors that fail to read: single readings that neither neighbour bears out, or none at all.

No law of a plant makes a reading jump away for one sample and come back, or stops its noise. So
this is told before any physics, for every signal of the recording, whether an equation reads it or
not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.coarse_steps import coarse_step
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import standing_still
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.recordings.thin import glitches_in

from rulec.mismatch.answer_types.failed import failed
from rulec.mismatch.answer_types.result import Finding, Period

OFTEN, MANY = 0.005, 20
"""Share of all readings, and number, from which such readings are the sensor's fault."""


def failing(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Sensors that fail often, each as a finding."""
    shown = ruleset.dynamics.outputs if ruleset.dynamics is not None else ()
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or len(values) < MANY or not np.isfinite(values).any():
            continue
        odd = glitches_in(values)
        if odd.sum() >= max(MANY, OFTEN * len(values)):
            yield _dropping_out(signal, values, odd)
        # What is given is mostly set, and held.
        u = float(np.nanmedian(np.broadcast_to(systematic_u(signal, values), values.shape)))
        if spans := standing_still(
            values, u if signal.is_input else np.inf, (signal.lowest, signal.highest)
        ):
            yield _stuck(signal, recording.time, values, spans)
        # What is given may be set in steps.
        if signal.id in shown and (step := _coarse(signal, values)):
            yield _stepping(signal, step)


def _coarse(signal: SignalSpec, values: Array) -> float:
    u = systematic_u(signal, values)
    return coarse_step(values, float(np.nanmedian(np.broadcast_to(u, values.shape))))


def _stepping(signal: SignalSpec, step: float) -> Finding:
    text = (
        f"{signal.id} moves in steps of {step / signal.factor:.3g} {signal.unit}, far coarser than "
        "its class; nothing finer can be told from it"
    )
    return failed(signal, "coarse-steps", "Sensor that shows coarse steps", text)


def _stuck(signal: SignalSpec, time: Array, values: Array, spans: list[tuple[int, int]]) -> Finding:
    periods = tuple(Period(float(time[a]), float(time[b - 1]), 1.0, 0.0) for a, b in spans)
    when = ", ".join(f"{p.since:.0f} to {p.until:.0f} s" for p in periods)
    shown = (float(values[spans[0][0]]) - signal.offset) / signal.factor
    text = (
        f"{signal.id} is stuck from {when}, first at {shown:.4g} {signal.unit}: even its noise "
        "is gone; these readings are left out"
    )
    finding = failed(signal, "stuck-reading", "Sensor that is stuck", text)
    return replace(finding, periods=periods)


def _dropping_out(signal: SignalSpec, values: Array, odd: np.ndarray) -> Finding:
    away = float(np.median(np.abs(values[odd] - values[np.flatnonzero(odd) - 1]))) / signal.factor
    share = 100.0 * float(odd.mean())
    text = (
        f"{signal.id} drops out: {int(odd.sum())} single readings ({share:.1f} %) jump away by "
        f"about {away:.3g} {signal.unit} and back; they are left out"
    )
    return failed(signal, "drop-outs", "Sensor that drops out", text)
