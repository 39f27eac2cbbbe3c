"""An experiment: possible explanations, the steps that discriminate between them, and the predicted
readings; with its JSON form, and the explanations as a mismatch left them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.contract.ruleset_file import built
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.output.json_file import Damaged
from rulec_runtime.report.text import counted, number, percent

from rulec.effects.repair import AGAIN
from rulec.mismatch import limits
from rulec.mismatch.experiment.forecast import Advised
from rulec.mismatch.result import CandidateSet, ExperimentRefused


@dataclass(frozen=True)
class Reading:
    """Predictions of a signal in a step by each explanation, SI, the distance between explanations
    in units of the noise of one mean, and the standard deviation of each, SI."""

    signal: str
    values: tuple[float, ...]
    apart: float
    spread: tuple[float, ...]


@dataclass(frozen=True)
class Step:
    """An operating point to hold, with its time span, s, its inputs, SI, and its readings, the most
    significant signal first.

    The way there takes `ramp`, s, of that time. A step discriminates between explanations, or
    `covers` the range. `costs` names inputs and modules that cost product, `at_end` inputs at an
    end of their range.
    """

    since: float
    until: float
    inputs: Mapping[str, float]
    given: Mapping[str, float]
    readings: tuple[Reading, ...]
    ramp: float = 0.0
    costs: tuple[str, ...] = ()
    at_end: tuple[tuple[str, str], ...] = ()
    covers: bool = False


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """What to run, and the knowledge behind it.

    `certainty` is the expected probability of the true explanation before the first step and after
    each that discriminates; steps that cover come last and do not count. `unlisted` is the
    probability that none of `standing` is true. `factors`, shape (explanations, explanations), are
    expected log Bayes factors of all steps, nats. `set_by` are inputs with the range from which
    they were chosen, SI, and `present` their last values. With `limited`, these ranges and readings
    have limits: `hindering` are readings whose limits forbid better steps, `unwatched` those that
    no explanation predicts. `time_is_short`: longer experiments would be better. `left_out` remain
    possible but are not predicted, as they switched with set points. `sensors` would distinguish
    what these steps do not. `sample` is the usual time between two samples of the recording, s.
    """

    standing: tuple[CandidateSet, ...]
    left_out: tuple[CandidateSet, ...]
    steps: tuple[Step, ...]
    certainty: tuple[float, ...]
    unlisted: float
    factors: Array
    set_by: Mapping[str, tuple[float, float]]
    present: Mapping[str, float]
    limited: bool
    hindering: tuple[str, ...]
    unwatched: tuple[str, ...]
    time_is_short: bool
    sensors: tuple[Advised, ...]
    sample: float

    @property
    def telling(self) -> tuple[Step, ...]:
        """The steps that discriminate between explanations."""
        return tuple(step for step in self.steps if not step.covers)

    @property
    def headline(self) -> str:
        """The value of the experiment, in one sentence."""
        steps = counted(len(self.steps), "step")
        if len(self.standing) == 1:
            if not self.steps:
                return "One explanation is left, and no input may be changed to test it."
            return (
                f"One explanation is left. {steps} in {duration(self.steps[-1].until)} test "
                "it: they cover the permitted range, and show what it does not predict."
            )
        if not self.telling:
            extent, wider = "what was recorded", "Record wider ranges"
            if self.limited:
                extent, wider = "the limits", "Allow wider ranges"
            return (
                f"No set points within {extent} separate these explanations. {wider}, or record "
                "another quantity."
            )
        before, after = percent(self.certainty[0]), percent(self.certainty[-1])
        return (
            f"On average, the true explanation, if it is one of these, will have a probability of "
            f"{after} after {steps} ({duration(self.steps[-1].until)}); now it is {before}."
        )


def alike(factors: Array) -> tuple[tuple[int, int], ...]:
    """Pairs of explanations that are not distinguished, by their numbers."""
    apart = np.minimum(factors, factors.T)
    every = zip(*np.triu_indices(len(apart), 1), strict=True)
    return tuple((int(i), int(j)) for i, j in every if apart[i, j] < limits.TOLD_APART)


def in_words(one: CandidateSet) -> str:
    """A set of explanations in words."""
    return " and ".join(one.titles) or "nothing is missing"


def duration(seconds: float) -> str:
    """A time in the most suitable unit."""
    if seconds < 120.0:
        return f"{seconds:.3g}\u00a0s"
    if seconds < 7200.0:
        return f"{number(seconds / 60.0)}\u00a0min"
    return f"{number(seconds / 3600.0)}\u00a0h"


def possible_sets(data: Mapping[str, Any], file: Path) -> tuple[CandidateSet, ...]:
    """The explanations that a mismatch left possible; `file` is its name. Raises ExperimentRefused
    if the file does not say."""
    try:
        found: tuple[CandidateSet, ...] = built(tuple[CandidateSet, ...])(data["standing"])
    except (LookupError, TypeError, Damaged):
        raise ExperimentRefused(
            f"{file}: it does not say which explanations remain possible; {AGAIN}"
        ) from None
    if not found:
        raise ExperimentRefused(
            f"{file}: no sets of explanations were weighed. In plants that store they are not; a "
            "recording that cannot be judged has none"
        )
    return found


ROWS = (10, 600)
"""Fewest and most rows per step in the file of inputs."""


def experiment_form(found: Experiment, ruleset: Ruleset) -> dict[str, Any]:
    """The experiment as JSON data; values in the units of the signals, times in s."""
    signals = ruleset.signal_by_id

    def inputs(values: Mapping[str, float]) -> dict[str, Any]:
        return {
            name: {"value": _shown(signals[name], value), "unit": signals[name].unit}
            for name, value in values.items()
        }

    return {
        "headline": found.headline,
        "explanations": [
            {"names": list(one.names), "title": in_words(one), "probability": one.probability}
            for one in found.standing
        ],
        "certainty": list(found.certainty),
        "unlisted": found.unlisted,
        "factors": found.factors.tolist(),
        "alike": [list(pair) for pair in alike(found.factors)],
        "sensors": [
            {
                "explanations": list(one.pair),
                "module": one.sensor.quantity[0],
                "signal": one.sensor.quantity[1] or None,
                "title": one.sensor.title,
                "class": one.sensor.kind.name,
                "cost": one.sensor.cost,
                "apart": one.apart,
                "difference": (one.values[1] - one.values[0]) / one.sensor.factor,
                "u": one.u / one.sensor.factor,
                "unit": one.sensor.unit,
            }
            for one in found.sensors
        ],
        "limits": {
            "given": found.limited,
            "forbid_more": list(found.hindering),
            "not_foretold": list(found.unwatched),
            "time_is_short": found.time_is_short,
        },
        "steps": [
            {
                "from": step.since,
                "until": step.until,
                "ramp": step.ramp,
                "covers": step.covers,
                "costs_product": list(step.costs),
                "at_end": [{"input": name, "end": end} for name, end in step.at_end],
                "inputs": inputs(step.inputs),
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
            for step in found.steps
        ],
    }


def _shown(signal: SignalSpec, value: float) -> float:
    """A value, SI, in the signal's unit, rounded to ten digits: 14 L/h, not 14.000000000000002."""
    return float(f"{signal.shown(value):.10g}")


def inputs_csv(found: Experiment, ruleset: Ruleset) -> str:
    """A recording of the inputs for `rulec simulate`, sampled like the last; others as expected."""
    signals = ruleset.signal_by_id
    names = sorted({name for step in found.steps for name in (*step.inputs, *step.given)})
    lines = [row_of(("time [s]", *(f"{name} [{signals[name].unit}]" for name in names)))]
    before: Mapping[str, float] = found.present
    for step in found.steps:
        values = {**step.given, **step.inputs}
        lasts = step.until - step.since
        rows = min(max(math.ceil(lasts / found.sample), ROWS[0]), ROWS[1])
        for gone in lasts * np.arange(rows) / rows:
            left = 1.0 - gone / step.ramp if gone < step.ramp else 0.0
            now = {n: v + left * (before.get(n, v) - v) for n, v in values.items()}
            shown = [f"{signals[name].shown(now[name]):.8g}" for name in names]
            lines.append(row_of((f"{step.since + gone:.10g}", *shown)))
        before = step.inputs
    return "\n".join(lines) + "\n"
