"""Plants in which hundreds of estimates check each other: no table of all their covariances.

A few points at a time, in order of time, are observed, compared with the baseline before them and
explained. Of the covariance of all estimates, only the part that a stack of stretches needs is
kept.
"""

from dataclasses import replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.observe import Observed
from rulec_runtime.diagnosis.steady.redundancy import residual_basis


def has_many(ruleset: Ruleset) -> bool:
    """Whether so many estimates check each other that tables of all of them cost too much."""
    every = np.ones(len(ruleset.observers), dtype=bool)
    # A basis is expensive, and there are never more residuals than estimates.
    few = len(every) < limits.MANY_RESIDUALS
    return not few and len(residual_basis(ruleset, every)) >= limits.MANY_RESIDUALS


def at_once(ruleset: Ruleset) -> int:
    """Points whose covariances are worked on together."""
    return max(limits.ESTIMATES_AT_ONCE // max(len(ruleset.observers), 1) ** 2, 1)


def without_tables(observed: Observed) -> Observed:
    """What is kept of some points: of the tables of all covariances only what stacks need."""
    nothing = np.zeros((len(observed), 0, 0))
    u = np.sqrt(np.diagonal(observed.covariance, axis1=1, axis2=2)).T
    return replace(observed, scatter=nothing, covariance=nothing, wander=nothing, u=u)
