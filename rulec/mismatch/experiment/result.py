"""An experiment: what stands, which steps tell it apart, and what is read if each is true."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.candidate_sets import Standing
from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.sensors import Advised


@dataclass(frozen=True)
class Reading:
    """What a signal shows in a step under each explanation, SI, how far the explanations are apart,
    in units of the noise of one mean, and the standard deviation of each, SI."""

    signal: str
    values: tuple[float, ...]
    apart: float
    spread: tuple[float, ...]


@dataclass(frozen=True)
class Step:
    """An operating point to hold: from when until when, s; inputs, SI; what is read, the most
    telling signal first.

    The way there takes `ramp`, s, of that time. It tells the explanations apart, or `covers` what
    may be set. `costs` names inputs and modules that cost product,
    `at_end` inputs with the end of what may be set that they are at.
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
    """What to run, and what is known behind it.

    `certainty` is the probability that the true explanation can be expected to have before the
    first step and after each that tells explanations apart; those that cover come last and are not
    counted. `unlisted` is the probability that it is none of `standing`: there it
    has none. `factors`, shape (explanations, explanations), are expected log Bayes factors of all
    steps, nats; `set_by` the inputs with the range within which they were chosen,
    SI, and `present` how they were last. With `limited` those ranges, and readings, have limits: of
    which `hindering` are readings whose limits forbid steps that tell more, and `unwatched` those
    that no explanation foretells. `time_is_short`: longer experiments tell more.
    `left_out` still stand and are not foretold: they switched with set points.
    `sensors` would tell apart what these steps do not. `sample` is the usual time between two
    samples of the recording, s; `read` what an equation or an explanation reads.
    """

    standing: tuple[Standing, ...]
    left_out: tuple[Standing, ...]
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
    read: frozenset[str]

    @property
    def telling(self) -> tuple[Step, ...]:
        """The steps that tell explanations apart."""
        return tuple(step for step in self.steps if not step.covers)

    @property
    def alike(self) -> tuple[tuple[int, int], ...]:
        """Explanations that these steps do not tell apart, by their numbers."""
        return alike(self.factors)


def alike(factors: Array) -> tuple[tuple[int, int], ...]:
    """Pairs of explanations that are not told apart, by their numbers."""
    apart = np.minimum(factors, factors.T)
    every = zip(*np.triu_indices(len(apart), 1), strict=True)
    return tuple((int(i), int(j)) for i, j in every if apart[i, j] < limits.TOLD_APART)
