"""An experiment: what stands, which steps tell it apart, and what is read if each is true."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.system import system_of
from rulec.mismatch.experiment.choose import Choice, chosen
from rulec.mismatch.experiment.foretell import Foretold, Places, foretold
from rulec.mismatch.experiment.reach import places_in, usual_reach
from rulec.mismatch.result import Standing
from rulec.mismatch.search.settled.standing import refitted_again


class ExperimentRefused(Exception):
    """No experiment can be planned; the message says why and what to do."""


@dataclass(frozen=True)
class Reading:
    """What a signal shows in a step under each explanation, SI, and how far the explanations are
    apart, in units of the noise of one mean."""

    signal: str
    values: tuple[float, ...]
    apart: float


@dataclass(frozen=True)
class Step:
    """An operating point to hold: from when until when, s; inputs, SI; what is read, the most
    telling signal first."""

    since: float
    until: float
    inputs: Mapping[str, float]
    given: Mapping[str, float]
    readings: tuple[Reading, ...]


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """What to run, and what is known behind it.

    `certainty` is the probability that the true explanation can be expected to have before the
    first step and after each; `factors`, shape (explanations, explanations), are expected log Bayes
    factors of all steps, nats; `set_by` the inputs with the range within which they were chosen.
    """

    standing: tuple[Standing, ...]
    steps: tuple[Step, ...]
    certainty: tuple[float, ...]
    factors: Array
    set_by: Mapping[str, tuple[float, float]]

    @property
    def alike(self) -> tuple[tuple[int, int], ...]:
        """Explanations that these steps do not tell apart, by their numbers."""
        apart = np.minimum(self.factors, self.factors.T)
        every = zip(*np.triu_indices(len(apart), 1), strict=True)
        return tuple((int(i), int(j)) for i, j in every if apart[i, j] < limits.TOLD_APART)


def planned(
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
    standing: Sequence[Standing],
    most: int,
    seconds: float,
) -> Experiment:
    """The steps that best tell apart what stands, in a given time, s, at most.

    Raises ExperimentRefused where one explanation stands alone, or nothing can be set.
    """
    if len(standing) < 2:
        raise ExperimentRefused("one explanation stands alone: there is nothing to tell apart")
    if most < 1:
        raise ExperimentRefused(f"--steps {most}: an experiment has one step at least")
    data = prepare(recording, ruleset)
    assert data is not None
    every = rows_of(system_of(ruleset, builder, data), Configuration())
    try:
        again = refitted_again(every, standing)
    except KeyError as error:
        raise ExperimentRefused(
            f"nothing in this plant is called {error.args[0]}; run rulec mismatch again"
        ) from None
    geometry = again.geometry
    system = geometry.rows.system
    reach = usual_reach(system)
    if not reach.ranges:
        raise ExperimentRefused(
            "no input was changed in the recording, so how far one may be changed is not known"
        )
    if not seconds >= reach.step:
        raise ExperimentRefused(
            f"--hours {seconds / 3600.0:g}: one step takes {reach.step / 3600.0:.3g} hours, the "
            "usual time from one settled mean of the recording to the next"
        )
    places = places_in(system, reach)
    told = [foretold(geometry, again.models, i, places) for i in range(len(standing))]
    odds = np.array([one.probability for one in standing])
    choice = chosen(told, odds / odds.sum(), int(min(most, seconds // reach.step)))
    return Experiment(
        standing=tuple(standing),
        steps=_steps(choice, told, places, system.data.noise, system.data.values, reach.step),
        certainty=choice.certainty,
        factors=choice.factors,
        set_by=reach.ranges,
    )


def _steps(
    choice: Choice,
    told: Sequence[Foretold],
    places: Places,
    noise: Mapping[str, Array],
    recorded: Mapping[str, Array],
    step: float,
) -> tuple[Step, ...]:
    steps = []
    for number, place in enumerate(choice.places):
        near = places.near[place]
        inputs = {name: float(values[place]) for name, values in places.inputs.items()}
        readings = []
        for name in told[0].readings:
            values = tuple(float(one.readings[name][place]) for one in told)
            apart = (max(values) - min(values)) / float(noise[name][near])
            readings.append(Reading(name, values, apart))
        given = {
            name: float(values[near])
            for name, values in recorded.items()
            if name not in inputs and name not in told[0].readings
        }
        ordered = tuple(sorted(readings, key=lambda reading: -reading.apart))
        steps.append(Step(number * step, (number + 1) * step, inputs, given, ordered))
    return tuple(steps)
