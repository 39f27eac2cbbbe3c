"""Sensors that fail, whatever the plant does: told beside all physics.

A reading that its sensor cannot show is left out by everything that compares estimates. Where that
is most of them it must not pass in silence.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors.conditions import STUCK, SensorFinding
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.observe import outside_range
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.answer_types.result import Finding, Location, Period

SURE = 0.99
"""Nothing else does this [assumed]."""

MOSTLY, FEWEST = 0.5, 12
"""Share of its readings, and number, from which on a sensor is told to show what cannot be."""


def impossible(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Sensors that mostly show what they cannot, each as a finding."""
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or signal.lowest is None or signal.highest is None:
            continue
        seen = values[np.isfinite(values)]
        wrong = int(outside_range(signal, seen).sum())
        if wrong >= max(FEWEST, MOSTLY * len(seen)):
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


def failed(signal: SignalSpec, name: str, title: str, text: str) -> Finding:
    """A sensor that fails, as a finding."""
    module, _, place = signal.id.partition(".")
    return Finding(
        f"{signal.id}.{name}",
        "sensor",
        name,
        title,
        module,
        place,
        {},
        "",
        text,
        "check cable, mounting and supply of the sensor",
        "",
        SURE,
        (),
        0.0,
        (),
        (),
        0.0,
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
