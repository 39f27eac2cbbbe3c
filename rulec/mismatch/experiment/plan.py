"""Plan an experiment: refit the possible explanations, find the inputs, choose steps, predict
readings.
"""

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.limits import SETTLING
from rulec_runtime.recordings.recording import Recording

from rulec.effects.model_builder import ModelBuilder
from rulec.mismatch import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.system import System, system_of
from rulec.mismatch.experiment.forecast import Forecast, advised, forecast
from rulec.mismatch.experiment.points import Feasible, feasible, input_ranges, points_in, usual_step
from rulec.mismatch.experiment.result import Experiment, Reading, Step, alike
from rulec.mismatch.result import CandidateSet, ExperimentRefused
from rulec.mismatch.search.later_refits import Again, refitted_again
from rulec.separation.allowed import Allowed, allowed_of

# Which operating points discriminate between explanations, how long to hold them, which cover the
# rest.
#
# A step is worth the increase of the expected probability of the true explanation. The log odds of
# that one against another grow by a log Bayes factor. Between normal distributions its mean is
# their divergence f, and its variance is 2 f if their covariances are alike. Longer steps average
# noise but cost time, so each doubling has to be worth it.
#
# Steps that discriminate are only as good as the explanations. The truth may be none of them, or
# bend where nothing was recorded; so the other steps lie far from each other along each input.
#
# Source: Box and Hill 1967; Hunter and Reiner 1965 (discrimination between models); Kullback and
# Leibler 1951; Joseph, Gul and Ba 2015 (maximum projection designs); Box and Draper 1959.


@dataclass(frozen=True)
class Choice:
    """Points in the order of choice.

    `certainty` is the expected probability of the true explanation before the first point and after
    each; `worth` is that after all of them, given that it is one of these. `factors`, shape
    (explanations, explanations), are expected log Bayes factors, nats, of the row's explanation, if
    true, against the column's.
    """

    numbers: tuple[int, ...]
    certainty: tuple[float, ...]
    worth: float
    factors: Array


def chosen(
    predicted: Sequence[Forecast],
    odds: Array,
    most: int,
    *,
    among: NDArray[np.bool_] | None = None,
    in_time: Callable[[Sequence[int]], bool] = lambda numbers: True,
) -> Choice:
    """Up to `most` points, each the one that adds most to those before.

    `predicted` has one entry per explanation as the true one, `odds` their probabilities. `among`,
    shape (n,), flags points that may be chosen; `in_time` says whether there is time for some
    points.
    """
    every = sorted(set(predicted[0].point.tolist()).intersection(*(one.point for one in predicted)))
    left = [number for number in every if among is None or among[number]]
    numbers: list[int] = []
    found = [np.zeros((len(odds), len(odds)))]
    shares = odds / odds.sum()
    worth = [certain(shares, found[0])]
    while left and len(numbers) < most:
        after = np.array([factors(one, i, numbers, left) for i, one in enumerate(predicted)])
        sure = [
            certain(shares, after[:, :, i]) if in_time([*numbers, number]) else 0.0
            for i, number in enumerate(left)
        ]
        best = int(np.argmax(sure))
        if not sure[best] > 0.0:
            break
        numbers.append(left.pop(best))
        found.append(after[:, :, best])
        worth.append(sure[best])
    # Two steps may discriminate where one does not.
    best_count = int(np.argmax(np.array(worth) - limits.WORTH_A_STEP * np.arange(len(worth))))
    certainty = tuple(certain(odds, own) for own in found[: best_count + 1])
    return Choice(tuple(numbers[:best_count]), certainty, worth[best_count], found[best_count])


NODES, SHARES = np.polynomial.hermite_e.hermegauss(limits.SCATTER_NODES)
"""Nodes and weights of an average over a normal deviate."""


def certain(odds: Array, factors: Array) -> float:
    """Expected probability of the true explanation.

    `factors` are expected log Bayes factors, nats, shape (explanations, explanations). What `odds`
    lack to 1 is that none of these is true: no reading counts against that, and nothing is gained
    if it is.
    """
    unlisted = max(1.0 - float(odds.sum()), 0.0)
    read = factors + NODES[:, None, None] * np.sqrt(2.0 * factors)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        others = (odds[None, :] / odds[:, None] * np.exp(-read)).sum(axis=2)
        sure = np.where(odds > 0.0, 1.0 / (others + unlisted / odds), 0.0)
    return float(SHARES @ sure @ odds / SHARES.sum())


def factors(predicted: Forecast, true: int, taken: Sequence[int], numbers: Sequence[int]) -> Array:
    """Expected log Bayes factors of the true explanation against each by readings at the known
    points and each of some others; nats, shape (explanations, points)."""
    most = int(np.bincount(predicted.point).max())
    each = [[*taken, number] for number in numbers]
    # Numbers of the rows that are read, shape (points, rows); negative ones are padding.
    rows = np.tile(-1 - np.arange(len(each[0]) * most), (len(each), 1))
    for line, read in zip(rows, each, strict=True):
        there = np.flatnonzero(np.isin(predicted.point, read))
        line[: len(there)] = there
    pairs = rows[:, :, None], rows[:, None, :]
    own = np.linalg.cholesky(predicted.between(true, *pairs))
    found = []
    for other, off in enumerate(predicted.off):
        factor = np.linalg.cholesky(predicted.between(other, *pairs))
        apart = np.where(rows >= 0, (predicted.off[true] - off)[rows], 0.0)
        parts = np.linalg.solve(factor, np.concatenate([apart[:, :, None], own], axis=2))
        grown = np.linalg.slogdet(factor)[1] - np.linalg.slogdet(own)[1]
        found.append(grown + 0.5 * ((parts**2).sum(axis=(1, 2)) - rows.shape[1]))
    return np.maximum(found, 0.0)


@dataclass(frozen=True)
class Best:
    """Points chosen within limits, and what each explanation predicts for means over the time of
    holding; readings whose limits forbid better points, and whether time does."""

    choice: Choice
    predicted: Sequence[Forecast]
    limited: Feasible
    hindering: tuple[str, ...]
    time_is_short: bool


def best_choice(
    predicted: Sequence[Forecast],
    odds: Array,
    most: int,
    seconds: float,
    limited: Feasible,
    settling: float,
) -> Best:
    """The points that discriminate best within limits, and how long to hold them; readings take
    `settling`, s. Points that cost no product are preferred."""

    def plan(held: int, among: NDArray[np.bool_], until: float = seconds) -> Choice:
        longer, own = _held(predicted, limited, held, settling)
        return chosen(longer, odds, most, among=among, in_time=lambda p: own.seconds(p) <= until)

    @functools.cache
    def best(held: int) -> Choice:
        choice = plan(held, limited.may_run)
        if any(limited.costs[number] for number in choice.numbers):
            spared = plan(held, limited.free)
            if spared.worth >= choice.worth - limits.WORTH_COST:
                return spared
        return choice

    def worth(held: int) -> float:
        return best(held).worth - limits.WORTH_COST * math.log2(held)

    held, most_held = 1, seconds / limited.shortest
    while longer := [h for h in (2 * held, 4 * held) if h <= most_held and worth(h) > worth(held)]:
        held = max(longer, key=worth)
    choice = best(held)
    unhurried = [plan(times, limited.may_run, math.inf) for times in (held, 2 * held)]
    wider = plan(held, limited.possible) if limited.forbidden else choice
    better = wider.worth > choice.worth + limits.WORTH_A_STEP
    forbid = [n for n, there in limited.forbidden.items() if there[list(wider.numbers)].any()]
    return Best(
        choice,
        *_held(predicted, limited, held, settling),
        tuple(forbid) if better else (),
        any(one.worth > choice.worth + limits.WORTH_COST for one in unhurried),
    )


def _held(
    predicted: Sequence[Forecast], limited: Feasible, held: int, settling: float
) -> tuple[Sequence[Forecast], Feasible]:
    """The predictions if each point is held `held` times as long as necessary."""
    least = limited.shortest - settling
    times = (held * limited.shortest - settling) / least if least > 0.0 else float(held)
    return [one.held(times) for one in predicted], replace(limited, held=held)


def covering(
    limited: Feasible, among: NDArray[np.bool_], steps: Sequence[int], most: int, seconds: float
) -> tuple[int, ...]:
    """Up to `most` points in addition to some steps, as long as there is time, s.

    Each is the one farthest from all others by the product of distances along each input; without
    any step the first is the middle. `among`, shape (n,), flags points that may be chosen.
    """
    ranges = limited.ranges.bounds.items()
    at = np.stack([(limited.points.inputs[n] - low) / (high - low) for n, (low, high) in ranges], 1)

    def near(point: Array) -> Array:
        """The criterion at all points by one point; infinite where they coincide."""
        apart = np.abs(at - point)
        # Values of an input are far enough apart if they are as far as `most` evenly spread ones.
        added: Array = 1.0 / np.prod(apart + 1.0 / most, axis=1) ** 2
        return np.where(apart.any(axis=1), added, np.inf)

    found: list[int] = []
    while len(found) < most:
        taken = [*steps, *found]
        left = [i for i in np.flatnonzero(among).tolist() if i not in taken]
        worst = np.sum([near(at[i]) for i in taken], axis=0)
        if not taken:
            worst = np.linalg.norm(at - at.mean(axis=0), axis=1)
        best = min(left, key=worst.__getitem__, default=-1)
        if best < 0 or worst[best] == np.inf or limited.seconds([*found, best]) > seconds:
            break
        found.append(best)
    return tuple(found)


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
    again = _refitted(recording, ruleset, builder, standing)
    system = again.evidence.rows.system
    sample = usual_step(recording.time)
    allowed = None if given is None else allowed_of(ruleset, given)
    ranges = input_ranges(system, recording, sample, allowed)
    if not ranges.bounds:
        raise ExperimentRefused(NO_RANGES if given is None else NOTHING_LEFT)
    points = points_in(system, ranges)
    predicted = [forecast(again.evidence, again.models, i, points) for i in range(len(again.sets))]
    limited = feasible(ruleset, points, ranges, predicted)
    if not seconds >= limited.shortest:
        raise ExperimentRefused(
            f"--hours {seconds / 3600.0:g}: one step takes {limited.shortest / 3600.0:.3g} hours"
        )
    odds = np.array([one.probability for one in again.sets])
    settling = 0.0 if system.data.of_rows else SETTLING * sample
    telling = min(most, limits.TELLING_STEPS)
    best = best_choice(predicted, odds, telling, seconds, limited, settling)
    first = best.choice.numbers
    steps = _steps(best.limited, first, best.predicted, system)
    # Steps that cover the range come after those that discriminate, without loss of product.
    held = math.ceil(limits.COVERING_HELD * ranges.step / limited.shortest)
    after = replace(limited, held=held, begun=first[-1] if first else -1)
    since = best.limited.seconds(first)
    more = covering(after, limited.free, first, most - len(first), seconds - since)
    steps += _steps(after, more, predicted, system, since, covers=True)
    return Experiment(
        standing=again.sets,
        left_out=tuple(one for one in standing if one not in again.sets),
        steps=steps,
        certainty=best.choice.certainty,
        unlisted=max(1.0 - float(odds.sum()), 0.0),
        factors=best.choice.factors,
        set_by=ranges.bounds,
        present=ranges.present,
        limited=given is not None,
        hindering=best.hindering,
        unwatched=limited.unwatched,
        time_is_short=best.time_is_short,
        sample=sample,
        sensors=advised(again.evidence, again.models, alike(best.choice.factors)),
    )


def _refitted(
    recording: Recording, ruleset: Ruleset, builder: ModelBuilder, standing: Sequence[CandidateSet]
) -> Again:
    """The possible explanations refitted, but for those that switched and cannot be predicted."""
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
    return again


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
    points, noise, signals = limited.points, system.data.noise, system.ruleset.signal_by_id
    for number, (ramp, hold) in zip(chosen, limited.times(chosen), strict=True):
        near = points.near[number]
        inputs = {name: float(values[number]) for name, values in points.inputs.items()}
        readings = []
        for name in predicted[0].readings:
            values = tuple(float(one.readings[name][number]) for one in predicted)
            spread = tuple(float(one.spread[name][number]) for one in predicted)
            if not all(map(math.isfinite, spread)):
                continue  # its module had not settled at the nearest recorded set points
            apart = (max(values) - min(values)) / float(noise[name][near])
            readings.append(Reading(name, values, apart, spread))
        given = {
            name: float(points.around[name][number] if name in points.around else values[near])
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
                costs=limited.costs[number],
                at_end=tuple(limited.at_end(number)),
                covers=covers,
            )
        )
        since += ramp + hold
    return tuple(steps)
