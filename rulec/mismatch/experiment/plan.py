"""Plan an experiment: refit the possible explanations, find the inputs, choose steps, predict
readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.limits import SETTLING
from rulec_runtime.recordings.recording import Recording

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits
from rulec.mismatch.candidate_sets import CandidateSet
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.system import System, system_of
from rulec.mismatch.experiment.choose import Best, best_within, covering
from rulec.mismatch.experiment.forecast import Forecast, forecast
from rulec.mismatch.experiment.points import Feasible, feasible, input_ranges, places_in
from rulec.mismatch.experiment.result import Experiment, Reading, Step, alike
from rulec.mismatch.experiment.sensors import advised
from rulec.mismatch.refused import ExperimentRefused
from rulec.mismatch.search.settled.candidate_sets import Again, refitted_again
from rulec.separation.allowed import Allowed, allowed_of

NO_RANGES = (
    "no input was changed in the recording, so how far one may be changed is not known; give "
    "limits with --limits"
)
NOTHING_LEFT = "the limits leave no input of the recording that may be changed"
"""Why no input can be set."""


def planned(
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
    standing: Sequence[CandidateSet],
    most: int,
    seconds: float,
    *,
    given: Allowed | None = None,
) -> Experiment:
    """The steps that discriminate best between possible explanations, and others that cover the
    range; within a given time, s, and within given limits, else within what was recorded.

    Raises ExperimentRefused if nothing can be set.
    """
    if most < 1:
        raise ExperimentRefused(f"--steps {most}: an experiment has one step at least")
    again, left_out = _refitted(recording, ruleset, builder, standing)
    system = again.geometry.rows.system
    sample = _sample(recording.time)
    allowed = None if given is None else allowed_of(ruleset, given)
    reach = input_ranges(system, recording, sample, allowed)
    if not reach.ranges:
        raise ExperimentRefused(NO_RANGES if given is None else NOTHING_LEFT)
    places = places_in(system, reach)
    predicted = [forecast(again.geometry, again.models, i, places) for i in range(len(again.sets))]
    limited = feasible(ruleset, places, reach, predicted)
    if not seconds >= limited.shortest:
        raise ExperimentRefused(
            f"--hours {seconds / 3600.0:g}: one step takes {limited.shortest / 3600.0:.3g} hours"
        )
    odds = np.array([one.probability for one in again.sets])
    settling = 0.0 if system.data.of_rows else SETTLING * sample
    telling = min(most, limits.TELLING_STEPS)
    best = best_within(predicted, odds, telling, seconds, limited, settling)
    steps = _steps(best.limited, best.choice.places, best.predicted, system)
    steps += _covering(limited, best, most - len(steps), seconds, predicted, system)
    return Experiment(
        standing=again.sets,
        left_out=left_out,
        steps=steps,
        certainty=best.choice.certainty,
        unlisted=max(1.0 - float(odds.sum()), 0.0),
        factors=best.choice.factors,
        set_by=reach.ranges,
        present=reach.present,
        limited=given is not None,
        hindering=best.hindering,
        unwatched=limited.unwatched,
        time_is_short=best.time_is_short,
        sample=sample,
        sensors=advised(again.geometry, again.models, alike(best.choice.factors)),
    )


def _refitted(
    recording: Recording, ruleset: Ruleset, builder: ModelBuilder, standing: Sequence[CandidateSet]
) -> tuple[Again, tuple[CandidateSet, ...]]:
    """The possible explanations refitted, and those that switched and cannot be predicted."""
    data = prepare(recording, ruleset)
    assert data is not None
    every = rows_of(system_of(ruleset, builder, data), Configuration())
    try:
        again = refitted_again(every, standing)
    except KeyError as error:
        raise ExperimentRefused(
            f"nothing in this plant is called {error.args[0]}; run rulec mismatch again"
        ) from None
    if len(again.sets) < min(len(standing), 2):
        raise ExperimentRefused(
            "what stands besides one explanation switched with the set points that were recorded; "
            "what it does at others is not known, so no set points can be planned that tell it"
        )
    return again, tuple(one for one in standing if one not in again.sets)


def _sample(time: Array) -> float:
    """The usual time between two samples, s."""
    between = np.diff(time)
    between = between[between > 0.0]
    return float(np.median(between)) if len(between) else limits.SHORTEST_STEP


def _covering(
    limited: Feasible,
    best: Best,
    most: int,
    seconds: float,
    predicted: Sequence[Forecast],
    system: System,
) -> tuple[Step, ...]:
    """Steps that cover the range, after those that discriminate and without loss of product."""
    telling = best.choice.places
    since = best.limited.seconds(telling)
    held = math.ceil(limits.COVERING_HELD * limited.reach.step / limited.shortest)
    after = replace(limited, held=held, begun=telling[-1] if telling else -1)
    places = covering(after, limited.free, telling, most, seconds - since)
    return _steps(after, places, predicted, system, since, covers=True)


def _steps(
    limited: Feasible,
    chosen: Sequence[int],
    predicted: Sequence[Forecast],
    system: System,
    since: float = 0.0,
    *,
    covers: bool = False,
) -> tuple[Step, ...]:
    """Steps in sequence, the first from `since` on, s."""
    steps: list[Step] = []
    places, noise, signals = limited.places, system.data.noise, system.ruleset.signal_by_id
    for place, (ramp, hold) in zip(chosen, limited.times(chosen), strict=True):
        near = places.near[place]
        inputs = {name: float(values[place]) for name, values in places.inputs.items()}
        readings = []
        for name in predicted[0].readings:
            values = tuple(float(one.readings[name][place]) for one in predicted)
            spread = tuple(float(one.spread[name][place]) for one in predicted)
            if not all(map(math.isfinite, spread)):
                continue  # its module had not settled at the nearest recorded set points
            apart = (max(values) - min(values)) / float(noise[name][near])
            readings.append(Reading(name, values, apart, spread))
        given = {
            name: float(places.around[name][place] if name in places.around else values[near])
            for name, values in system.data.values.items()
            if name in signals and name not in inputs and name not in predicted[0].readings
        }
        steps.append(
            Step(
                since=since,
                until=since + ramp + hold,
                inputs=inputs,
                given=given,
                readings=tuple(sorted(readings, key=lambda reading: -reading.apart)),
                ramp=ramp,
                costs=limited.costs[place],
                at_end=tuple(limited.at_end(place)),
                covers=covers,
            )
        )
        since += ramp + hold
    return tuple(steps)
