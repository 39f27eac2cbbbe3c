"""An experiment as JSON data, and as an input file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.csv_cell import row_of

from rulec.mismatch.experiment.result import Experiment, Step
from rulec.mismatch.experiment.sensors import Advised
from rulec.mismatch.experiment.words import headline, in_words

ROWS = (10, 600)
"""Fewest and most rows of the input file for each step."""


def experiment_form(found: Experiment, ruleset: Ruleset) -> dict[str, Any]:
    """The experiment as JSON data; values in the units of the signals, times in s."""
    signals = ruleset.signal_by_id
    return {
        "headline": headline(found),
        "explanations": [
            {"names": list(one.names), "title": in_words(one), "probability": one.probability}
            for one in found.standing
        ],
        "certainty": list(found.certainty),
        "unlisted": found.unlisted,
        "factors": found.factors.tolist(),
        "alike": [list(pair) for pair in found.alike],
        "sensors": [_advised(one, signals) for one in found.sensors],
        "limits": {
            "given": found.limited,
            "forbid_more": list(found.hindering),
            "not_foretold": list(found.unwatched),
            "time_is_short": found.time_is_short,
        },
        "steps": [_step(step, signals) for step in found.steps],
    }


def _advised(one: Advised, signals: Mapping[str, SignalSpec]) -> dict[str, Any]:
    sensor = one.sensor
    return {
        "explanations": list(one.pair),
        "module": sensor.quantity[0],
        "signal": sensor.quantity[1] or None,
        "title": sensor.title,
        "class": sensor.kind.name,
        "cost": sensor.cost,
        "apart": one.apart,
        "difference": (one.values[1] - one.values[0]) / sensor.factor,
        "u": one.u / sensor.factor,
        "unit": sensor.unit,
        "at": {
            name: {"value": _shown(signals[name], value), "unit": signals[name].unit}
            for name, value in one.at.items()
        },
    }


def _step(step: Step, signals: Mapping[str, SignalSpec]) -> dict[str, Any]:
    return {
        "from": step.since,
        "until": step.until,
        "ramp": step.ramp,
        "covers": step.covers,
        "costs_product": list(step.costs),
        "at_end": [{"input": name, "end": end} for name, end in step.at_end],
        "inputs": {
            name: {"value": _shown(signals[name], value), "unit": signals[name].unit}
            for name, value in step.inputs.items()
        },
        "readings": [
            {
                "signal": r.signal,
                "unit": signals[r.signal].unit,
                "values": [_shown(signals[r.signal], value) for value in r.values],
                "apart": r.apart,
                "u": [spread / abs(signals[r.signal].factor) for spread in r.spread],
            }
            for r in step.readings
        ],
    }


def _shown(signal: SignalSpec, value: float) -> float:
    """A value, SI, in the signal's unit, without what changing units leaves behind the tenth digit:
    14 L/h, and not 14.000000000000002."""
    return float(f"{signal.shown(value):.10g}")


def inputs_csv(found: Experiment, ruleset: Ruleset) -> str:
    """A recording of what is set, for `rulec simulate`, sampled as the last one was; what nobody
    sets is as it was recorded where an equation or an explanation reads it, and empty elsewhere."""
    signals = ruleset.signal_by_id
    names = sorted({name for step in found.steps for name in (*step.inputs, *step.given)})
    lines = [row_of(("time [s]", *(f"{name} [{signals[name].unit}]" for name in names)))]
    before: Mapping[str, float] = found.present
    for step in found.steps:
        values = {**step.given, **step.inputs}
        lasts = step.until - step.since
        rows = min(max(math.ceil(lasts / found.sample), ROWS[0]), ROWS[1])
        for part in range(rows):
            time = step.since + lasts * part / rows
            gone = (time - step.since) / step.ramp if time < step.since + step.ramp else 1.0
            now = {n: v + (1.0 - gone) * (before.get(n, v) - v) for n, v in values.items()}
            shown = [
                f"{signals[name].shown(now[name]):.8g}" if name in found.read else ""
                for name in names
            ]
            lines.append(row_of((f"{time:.10g}", *shown)))
        before = step.inputs
    return "\n".join(lines) + "\n"
