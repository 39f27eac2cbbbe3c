"""The verdict on a replay of a recording, with the weights of the search, to first order.

All is linear: values, errors of form and of sensors are normal with the precision of the model, and
so is the noise. So one table of products serves any number of replays.

Source: O'Hagan and Forster 2004, 9 (a linear model with normal priors).
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from scipy.special import log_ndtr

from rulec.mismatch import limits as common
from rulec.mismatch.evidence.evidence import Column, Evidence
from rulec.mismatch.evidence.term import Term
from rulec.mismatch.search import limits as of_search
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.scan import directions_of, term_gains
from rulec.mismatch.search.tolerance import Tolerance, least_beyond


@dataclass(frozen=True)
class Judged:
    """Posterior probabilities in replays, shape (..., replays), and the verdict in each, shape
    (replays,).

    `nothing` is that nothing is missing, `columns` are those of single columns. `best` is the
    number of the column that represents the most probable class, or behind the last one that of a
    term without a name; `sure` flags classes with enough probability.
    """

    nothing: Array
    columns: Array
    best: NDArray[np.intp]
    sure: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class Judge:
    """Weighs nothing, each column of each candidate, and each term without a name, in any replay.

    `candidates` is their number in the plant.
    """

    evidence: Evidence
    model: Model
    columns: Sequence[Column]
    terms: Sequence[Term]
    candidates: int

    @cached_property
    def rows(self) -> Array:
        """All columns, whitened, shape (rows, columns)."""
        if not self.columns:
            return np.zeros((len(self.model.table), 0))
        every = np.stack([c.rows for c in self.columns], axis=1)
        return self.evidence.whitened(every, self.model.noise)

    @cached_property
    def _terms(self) -> list[Array]:
        """Functions of each term, whitened, shape (rows, functions)."""
        return [self.evidence.whitened(t.columns, self.model.noise) for t in self.terms]

    @cached_property
    def owner(self) -> NDArray[np.str_]:
        """Id of the candidate of each column."""
        return np.array([c.candidate.id for c in self.columns], dtype=str)

    @cached_property
    def _shown(self) -> Array:
        """All columns, weighted, without the part that values can fit."""
        return self.model.alone(self.rows)

    @cached_property
    def _gram(self) -> Array:
        return np.asarray(np.maximum(np.sum(self.rows * self._shown, axis=0), 1e-12))

    @cached_property
    def alike(self) -> NDArray[np.bool_]:
        """Columns with the same signature once all values are fitted, shape (columns, columns).

        Columns with opposite signatures are alike only if their amplitudes may have either sign.
        """
        products = self.rows.T @ self._shown
        cosine = products**2 / np.outer(self._gram, self._gram)
        (below, above), same = (self.ends[0] < 0.0, self.ends[1] > 0.0), products > 0.0
        one_way = np.outer(above, above) | np.outer(below, below)
        other_way = np.outer(above, below) | np.outer(below, above)
        possible = np.where(same, one_way, other_way)
        return np.asarray(possible & (cosine > 1.0 - of_search.EFFECT_FORM**2))

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """Terms that contain a column as a special case, shape (columns, terms)."""
        size = np.sum(self.rows**2, axis=0)
        held = np.zeros((len(self.columns), len(self.terms)), dtype=bool)
        for i, columns in enumerate(self._terms):
            inside = np.sum((np.linalg.qr(columns)[0].T @ self.rows) ** 2, axis=0)
            held[:, i] = size - inside < of_search.EFFECT_FORM**2 * size
        return held

    @cached_property
    def odds(self) -> Array:
        """Prior log odds of each column, as in the search.

        A column without start values is of an explanation as found in a refitted set: the same law
        as the columns from which its fit started, with its bend.
        """
        keys = [
            (c.candidate.id, c.name, bool(c.course and c.values), not c.values)
            for c in self.columns
        ]
        ways, found = Counter(keys), []
        for c, (id_, name, tried, as_found) in zip(self.columns, keys, strict=True):
            count, begins = float(ways[id_, name, tried, as_found]), c.course is not None
            # Onsets are columns of their own, each with the penalty of an onset.
            count = max(count / common.ONSETS, 1.0) if tried else count
            if ways[id_, name, tried, not as_found]:
                count *= 2.0
            penalty = float(np.log(count)) + begins * float(np.log(common.ONSETS))
            penalty += of_search.COMMON * bool(c.candidate.members)
            found.append(of_search.SORT_ODDS[c.candidate.sort] - penalty)
        return np.array(found) + of_search.MISSING_ODDS - float(np.log(max(self.candidates, 1)))

    @cached_property
    def sizes(self) -> tuple[Array, Array, Array]:
        """The prior of each amplitude, SI, shape (columns,) each: a Student distribution about a
        usual size of either sign, with a width, and its degrees of freedom."""
        every = [self.evidence.size(c.candidate, c.amplitude) for c in self.columns]
        finite = np.array([np.isfinite(size.width) for size in every], dtype=bool)
        usual = np.where(finite, [size.usual for size in every], 0.0)
        width = np.where(finite, [size.width for size in every], [size.scale for size in every])
        return usual, width, np.array([size.freedom for size in every])

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """The range of each amplitude relative to its null, SI, shape (columns,) each."""
        null = np.array([c.amplitude.null or 0.0 for c in self.columns])
        low = np.array([c.amplitude.lowest for c in self.columns]) - null
        return low, np.array([c.amplitude.highest for c in self.columns]) - null

    def judged(self, replays: Array) -> Judged:
        """Probabilities of all explanations, and the most probable one; `replays` as drawn, shape
        (rows, replays)."""
        moment, count = self._shown.T @ replays, len(self.columns)
        none = np.zeros((1, replays.shape[1]))
        every = np.concatenate([none, self._evidence(moment), *self._of_terms(replays)])
        share = np.exp(every - np.logaddexp.reduce(every))
        out = np.abs(moment) >= self._least[:, None] * self._gram[:, None]
        columns = share[1 : 1 + count] * np.where(out, 1.0, 1.0 - of_search.INEXACT)
        best, probability = self._likeliest(columns, share[1 + count :])
        return Judged(share[0], columns, best, probability >= common.CERTAIN)

    def _likeliest(self, columns: Array, terms: Array) -> tuple[NDArray[np.intp], Array]:
        """The class of the most probable explanation of each replay, and its probability.

        A class consists of columns with the same signature, all columns of the same candidate, and
        terms without a name that contain them as a special case.
        """
        best, share = np.full(columns.shape[1], -1), np.zeros(columns.shape[1])
        if len(columns):
            number = np.unique(self.owner, return_inverse=True)[1]
            own = number == np.arange(number.max() + 1)[:, None]
            first = np.argmax(own @ columns, axis=0)
            best = np.argmax(np.where(own[first].T, columns, -1.0), axis=0)
            same = self.alike[best] | (number == first[:, None])
            share = np.sum(same * columns.T, axis=1)
            share = share + np.sum(self.held[best] * terms.T, axis=1)
        if self.terms:
            term = np.argmax(terms, axis=0)
            driver = np.array([t.driver for t in self.terms])
            of_terms = np.sum((driver == driver[term][:, None]) * terms.T, axis=1)
            best = np.where(of_terms > share, len(columns) + term, best)
            share = np.maximum(share, of_terms)
        return best, share

    @cached_property
    def _least(self) -> Array:
        """The smallest size at which each column is significant, SI, shape (columns,)."""
        off_by = Tolerance(self.evidence, self.model).off_by
        sorts = (
            (self.evidence.of_reading(c.candidate), c.course is not None) for c in self.columns
        )
        every = zip(self.columns, sorts, strict=True)
        return np.array([least_beyond(self.evidence, c.rows, off_by[own]) for c, own in every])

    def _evidence(self, moment: Array) -> Array:
        """Log odds of each column with amplitudes integrated out within their range, shape
        (columns, replays), by its moments of the same shape.

        As in the scan of the search, a prior is as wide as the recording asks, which costs as much
        as the tail of a Student distribution.
        """
        usual, own, freedom = (each[:, None] for each in self.sizes)
        (low, high), gram = (end[:, None] for end in self.ends), self._gram[:, None]
        found = np.abs(moment) / gram
        wide = np.maximum((found - usual) / own, 1.0)
        size, ways = own * wide, []
        for sign in (-1.0, 1.0):
            middle, precision = sign * usual, gram + size**-2.0
            at, root = (middle / size**2 - moment) / precision, np.sqrt(precision)
            gain = 0.5 * (precision * at**2 - (middle / size) ** 2 - np.log1p(gram * size**2))
            inside = _log_between((low - middle) / size, (high - middle) / size)
            ways.append(gain + _log_between((low - at) * root, (high - at) * root) - inside)
        return np.asarray(np.logaddexp(*ways) - freedom * np.log(wide) + self.odds[:, None])

    @cached_property
    def _directions(self) -> list[tuple[Array, Array]]:
        return [directions_of(self.model, columns) for columns in self._terms]

    def _of_terms(self, replays: Array) -> Iterator[Array]:
        """Log odds of each term without a name, shape (1, replays)."""
        ways = Counter((t.location, t.driver) for t in self.terms)
        count = len(common.TERM_SIZES) * max(self.evidence.term_count, 1)
        for term, directions in zip(self.terms, self._directions, strict=True):
            penalty = term.basis.penalty + float(np.log(count * ways[term.location, term.driver]))
            gains = np.logaddexp.reduce(term_gains(term, *directions, replays))
            yield gains[None] + (of_search.MISSING_ODDS + of_search.TERM_ODDS - penalty)


def _log_between(low: Array, high: Array) -> Array:
    """Log probability of a standard normal distribution between two ends."""
    turned = low > 0.0
    low, high = np.where(turned, -high, low), np.where(turned, -low, high)
    upper = log_ndtr(high)
    return np.asarray(upper + np.log1p(-np.exp(np.minimum(log_ndtr(low) - upper, -1e-12))))
