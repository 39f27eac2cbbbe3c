"""How sure the true explanation can be expected to be after some steps, over all that may be read.

The expected log Bayes factor chooses steps, but the probability that belongs to it is not the one
that can be expected: what is read scatters, and with it the factor, and what is surer than its mean
gains less than what is less sure loses. So readings are drawn as each explanation foretells them,
and judged with parts of the recording weighted at random: what a few states decide alone is not
sure.

What is not among the explanations is not foretold. Nothing that is read counts against it, so it
keeps what it has against the true one; and where it is true, none of the others is.

Source: Lindley 1956 (expected information of an experiment); Chaloner and Verdinelli 1995; Newton
and Raftery 1994 (weights at random).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from rulec.mismatch import limits
from rulec.mismatch.experiment.foretell import Foretold


def expected_certainty(
    foretold: Sequence[Foretold], odds: Array, places: Sequence[int]
) -> tuple[float, ...]:
    """Probability that the true explanation can be expected to have before the first of some places
    and after each.

    `foretold` has one entry per explanation as the true one, `odds`, shape (explanations,), their
    probabilities; what these lack to 1 is not among them.
    """
    random = np.random.default_rng(0)
    weights = random.exponential(size=(len(places), limits.DRAWN))
    found = [np.full((len(places) + 1, limits.DRAWN), own) for own in odds]
    unlisted = max(1.0 - float(odds.sum()), 0.0)
    with np.errstate(divide="ignore"):
        logs, unknown = np.log(odds), float(np.log(unlisted))
    for true, told in enumerate(foretold):
        gained = _gained(told, true, places, random) * weights[None]
        ahead = np.cumsum(gained, axis=1) + (logs - logs[true])[:, None, None]
        against = logsumexp(ahead, axis=0)
        found[true][1:] = np.exp(-np.logaddexp(against, unknown - logs[true]))
    expected = np.einsum("i,isd->s", odds, np.stack(found)) / limits.DRAWN
    return tuple(expected.tolist())


def _gained(told: Foretold, true: int, places: Sequence[int], random: np.random.Generator) -> Array:
    """What each step adds to the log likelihood of each explanation over the true one, nats, shape
    (explanations, steps, draws), with readings drawn as the true one foretells them."""
    rows = [np.flatnonzero(told.point == place) for place in places]
    at = np.concatenate([*rows, np.zeros(0, dtype=np.intp)])
    step = np.repeat(np.arange(len(places)), [len(own) for own in rows])
    every = range(len(told.covariance))
    factors = [np.linalg.cholesky(told.between(i, at[:, None], at[None, :])) for i in every]
    drawn = random.standard_normal((len(at), limits.DRAWN))
    read = told.off[true][at, None] + factors[true] @ drawn
    likelihood = np.zeros((len(factors), len(places), limits.DRAWN))
    for own, (off, factor) in enumerate(zip(told.off, factors, strict=True)):
        # Of each row what those before it leave open: so a step counts as what it adds.
        left = solve_triangular(factor, read - off[at, None], lower=True)
        np.add.at(likelihood[own], step, -0.5 * left**2 - np.log(np.diag(factor))[:, None])
    gained: Array = likelihood - likelihood[true]
    return gained
