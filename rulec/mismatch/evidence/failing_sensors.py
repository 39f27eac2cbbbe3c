"""Sensors that fail, whatever the plant does: reported beside all physics.

A reading that its sensor cannot show, one that stands still, one that jumps away for a sample and
comes back: everything that compares estimates leaves these out. Where they are many, that must not
pass in silence. So they are looked for in every signal, whether an equation reads it or not.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors.conditions import STUCK, SensorFinding
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.points import outside_range
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import standing_still
from rulec_runtime.recordings.stationary import systematic_u
from rulec_runtime.recordings.thin import glitches_in

from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.coarse_steps import coarse_step
from rulec.mismatch.result import Finding, Location, Period


def impossible(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Sensors that mostly show what they cannot, each as a finding."""
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or signal.lowest is None or signal.highest is None:
            continue
        seen = values[np.isfinite(values)]
        wrong = int(outside_range(signal, seen).sum())
        if wrong >= max(limits.IMPOSSIBLE_READINGS, limits.IMPOSSIBLE_SHARE * len(seen)):
            ends, usual = (
                (np.array(v) - signal.offset) / signal.factor
                for v in ([signal.lowest, signal.highest], np.median(seen))
            )
            text = (
                f"{signal.id} reads {usual:.4g} {signal.unit} (median), and {wrong} of "
                f"{len(seen)} readings lie outside of {ends[0]:.4g} to {ends[1]:.4g} "
                f"{signal.unit}, which is all that its sensor can show; they are left out"
            )
            yield failed(signal, "impossible-reading", "Sensor that shows what cannot be", text)


def stuck(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Sensors that are stuck, each as a finding with its periods."""
    found: dict[str, list[SensorFinding]] = {}
    for one in examine(recording, ruleset, by_model=False).findings:
        if one.condition is STUCK:
            found.setdefault(one.signal, []).append(one)
    for name, members in found.items():
        text = f"{members[0].text}; these readings are left out"
        finding = failed(ruleset.signal_by_id[name], "stuck-reading", "Sensor that is stuck", text)
        yield replace(finding, periods=tuple(Period(m.since, m.until, 1.0, 0.0) for m in members))


def failing(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Sensors that fail often, each as a finding."""
    shown = ruleset.dynamics.outputs if ruleset.dynamics is not None else ()
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if (
            values is None
            or len(values) < limits.DROP_OUT_READINGS
            or not np.isfinite(values).any()
        ):
            continue
        odd = glitches_in(values)
        if odd.sum() >= max(limits.DROP_OUT_READINGS, limits.DROP_OUT_SHARE * len(values)):
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


def failed(signal: SignalSpec, name: str, title: str, text: str) -> Finding:
    """A sensor that fails, as a finding."""
    module, _, place = signal.id.partition(".")
    return Finding(
        id=f"{signal.id}.{name}",
        sort="sensor",
        name=name,
        title=title,
        module=module,
        place=place,
        parameters={},
        equation="",
        text=text,
        action="check cable, mounting and supply of the sensor",
        source="",
        probability=limits.SENSOR_FAILS,
        alternatives=(),
        gain=0.0,
        rivals=(),
        periods=(),
        closed=0.0,
    )


def failed_at(finding: Finding) -> Location:
    """Where a sensor fails."""
    periods = tuple((p.since, p.until) for p in finding.periods)
    return Location(
        module=finding.module,
        place=finding.place,
        title="",
        share=float("nan"),
        region=(),
        periods=periods,
    )
