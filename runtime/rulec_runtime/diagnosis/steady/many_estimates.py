"""Plants in which hundreds of estimates check each other: no table of all their covariances.

A few points at a time, in order of time, are observed, compared with the baseline before them and
explained. Of the covariance of all estimates, only the part that a stack of stretches needs is
kept.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import Baselines, against
from rulec_runtime.diagnosis.steady.batches import Tables
from rulec_runtime.diagnosis.steady.isolate import POINTS_ALONG as EXPLAINED_ALONG
from rulec_runtime.diagnosis.steady.isolate import Isolation, isolate
from rulec_runtime.diagnosis.steady.learn_baseline import Learner
from rulec_runtime.diagnosis.steady.observe import POINTS_ALONG, Observed
from rulec_runtime.diagnosis.steady.redundancy import residual_basis
from rulec_runtime.recordings.larger_than_memory import arrays, let_go

KEPT_ALONG = {n: a for n, a in POINTS_ALONG.items() if n not in ("noise", "shared")} | {"u": 1}
"""Axis of the points in each kept table of an `Observed`."""


@dataclass(frozen=True, kw_only=True)
class Many:
    """Points as observed, relative to their baselines, and explained."""

    plain: Observed
    compared: Observed
    baselines: Baselines
    isolation: Isolation


def has_many(ruleset: Ruleset) -> bool:
    """Whether so many estimates check each other that tables of all of them cost too much."""
    every = np.ones(len(ruleset.observers), dtype=bool)
    # A basis is expensive, and there are never more residuals than estimates.
    few = len(every) < limits.MANY_RESIDUALS
    return not few and len(residual_basis(ruleset, every)) >= limits.MANY_RESIDUALS


def at_once(ruleset: Ruleset) -> int:
    """Points whose covariances are worked on together."""
    return max(limits.ESTIMATES_AT_ONCE // max(len(ruleset.observers), 1) ** 2, 1)


def see_many(ruleset: Ruleset, count: int, of_batch: Callable[[slice], Observed]) -> Many:
    """Judge so many points in order of time; `of_batch` observes a few of them."""
    learner = Learner(ruleset, keep=False)
    plain, compared, isolations = [], [], []
    tables: list[Array] = []
    for low in range(0, count, at_once(ruleset)):
        part = slice(low, min(low + at_once(ruleset), count))
        here = of_batch(part)
        found = against(ruleset, here, learner.take(here, low))
        isolations.append(isolate(ruleset, found, count))
        both = here.noise, np.moveaxis(here.shared, -1, 0)
        tables = tables or arrays([((count, *one.shape[1:]), float) for one in both])
        for table, one in zip(tables, both, strict=True):
            table[part] = one
        plain.append(_without_tables(here))
        compared.append(_without_tables(found))
        let_go(*tables)
    kept: dict[str, Any] = {"noise": tables[0], "shared": np.moveaxis(tables[1], 0, -1)}
    return Many(
        plain=replace(_joined(plain, KEPT_ALONG), **kept),
        compared=replace(_joined(compared, KEPT_ALONG), **kept),
        baselines=learner.baselines(),
        isolation=_joined(isolations, EXPLAINED_ALONG),
    )


def _without_tables(observed: Observed) -> Observed:
    """The part of some points that is kept beside the two large tables."""
    nothing = np.zeros((len(observed), 0, 0))
    names = ("noise", "shared", "scatter", "covariance", "wander")
    tables: dict[str, Any] = dict.fromkeys(names, nothing)
    u = np.sqrt(np.diagonal(observed.covariance, axis1=1, axis2=2)).T
    return replace(observed, **tables, u=u)


def _joined(parts: Sequence[Tables], along: Mapping[str, int]) -> Tables:
    tables: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=axis)
        for name, axis in along.items()
    }
    return cast(Tables, replace(cast(Any, parts[0]), **tables))
