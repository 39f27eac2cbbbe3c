"""Sensors that fail, whatever the plant does: reported apart from all physics.

Impossible readings, readings that are stuck and single readings that jump away and back take no
part in any comparison of estimates. Many of them must not go unreported, so every signal is
examined, whether an equation reads it or not.
"""

from collections.abc import Iterator

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.diagnosis.sensors.conditions import STUCK, SensorFinding
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.steady.points import outside_range
from rulec_runtime.recordings.columns import coarse_step, glitches_in
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import systematic_u

from rulec.mismatch.evidence import limits
from rulec.mismatch.result import Finding, Location, Period


def step_of_display(signal: SignalSpec, values: Array) -> float:
    """The step of a display, SI, if that is far beyond the class of its sensor; else 0."""
    return coarse_step(values, limits.COARSE_BEYOND * median_u(signal, values))


def median_u(signal: SignalSpec, values: Array) -> float:
    """Median systematic uncertainty of readings, SI."""
    return float(np.nanmedian(np.broadcast_to(systematic_u(signal, values), values.shape)))


def impossible(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Findings for sensors whose readings are mostly impossible."""
    for signal in ruleset.signals:
        values = recording.values.get(signal.id)
        if values is None or signal.lowest is None or signal.highest is None:
            continue
        finite = values[np.isfinite(values)]
        wrong = int(outside_range(signal, finite).sum())
        if wrong >= max(limits.IMPOSSIBLE_READINGS, limits.IMPOSSIBLE_SHARE * len(finite)):
            ends, usual = (
                (np.array(v) - signal.offset) / signal.factor
                for v in ([signal.lowest, signal.highest], np.median(finite))
            )
            text = (
                f"{signal.id} reads {usual:.4g} {signal.unit} (median), and {wrong} of "
                f"{len(finite)} readings lie outside of {ends[0]:.4g} to {ends[1]:.4g} "
                f"{signal.unit}, which is all that its sensor can show; they are left out"
            )
            yield _failed(signal, "impossible-reading", "Sensor with impossible readings", text)


def stuck(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Findings for sensors that are stuck, with the periods."""
    found: dict[str, list[SensorFinding]] = {}
    for one in examine(recording, ruleset, by_model=False).findings:
        if one.condition is STUCK:
            found.setdefault(one.signal, []).append(one)
    for name, members in found.items():
        text = f"{members[0].text}; these readings are left out"
        periods = tuple(Period(m.since, m.until, 1.0, 0.0) for m in members)
        title = "Sensor that is stuck"
        yield _failed(ruleset.signal_by_id[name], "stuck-reading", title, text, periods)


def failing(recording: Recording, ruleset: Ruleset) -> Iterator[Finding]:
    """Findings for sensors of a plant that stores that drop out often or have a coarse display."""
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
        # Inputs may be set in steps.
        if signal.id in shown and (step := step_of_display(signal, values)):
            text = (
                f"{signal.id} moves in steps of {step / signal.factor:.3g} {signal.unit}, far "
                "coarser than its class; it shows nothing finer"
            )
            yield _failed(signal, "coarse-steps", "Sensor that shows coarse steps", text)


def _dropping_out(signal: SignalSpec, values: Array, odd: np.ndarray) -> Finding:
    away = float(np.median(np.abs(values[odd] - values[np.flatnonzero(odd) - 1]))) / signal.factor
    share = 100.0 * float(odd.mean())
    text = (
        f"{signal.id} drops out: {int(odd.sum())} single readings ({share:.1f} %) jump away by "
        f"about {away:.3g} {signal.unit} and back; they are left out"
    )
    return _failed(signal, "drop-outs", "Sensor that drops out", text)


def _failed(
    signal: SignalSpec, name: str, title: str, text: str, periods: tuple[Period, ...] = ()
) -> Finding:
    module, _, place = signal.id.partition(".")
    return Finding(
        id=f"{signal.id}.{name}",
        sort="sensor",
        name=name,
        title=title,
        module=module,
        place=place,
        text=text,
        action="check cable, mounting and supply of the sensor",
        probability=limits.SENSOR_FAILS,
        periods=periods,
    )


def failed_at(finding: Finding) -> Location:
    """The location and periods of a sensor that fails."""
    periods = tuple((p.since, p.until) for p in finding.periods)
    return Location(module=finding.module, place=finding.place, title="", periods=periods)
