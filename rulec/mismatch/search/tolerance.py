"""The change that an explanation makes, compared with the possible errors of laws and sensors.

A name is certain only if it moves some reading by more than laws and sensors may be off.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from rulec_runtime.contract.plan import Array
from scipy.special import ndtr

from rulec.effects.candidate import TIME
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.configuration import ERROR
from rulec.mismatch.evidence.evidence import Evidence, amplitudes_of
from rulec.mismatch.evidence.term import Term
from rulec.mismatch.search.refit import Model
from rulec.mismatch.search.scan import indices_of


@dataclass(frozen=True)
class Tolerance:
    """How far readings may be off under a complete model, and which explanations exceed that."""

    evidence: Evidence
    model: Model

    @cached_property
    def stand_out(self) -> dict[str, float]:
        """Probability that each explanation, by id, moves some output by more than `off_by`.

        Its slopes are those from the null to its value: at the value itself a stop or an open
        relief valve has hardly any.
        """
        model, setting = self.model, self.model.setting
        begun = {setting.candidate_of(course).id for course in setting.courses}
        readings = {c.id for c in setting.joined if self.evidence.of_reading(c)}
        found: dict[str, float] = {}
        for i, id_, start in self._amplitudes:
            slopes = model.point.jacobian[:, i]
            if model.at[i] != start:
                without = np.where(np.arange(len(model.at)) == i, start, model.at)
                rest = self.evidence.evaluated(setting, model.prior, without).residual
                moved = (model.point.residual - rest) / (model.at[i] - start)
                slopes = moved if np.isfinite(moved).all() else slopes
            least = least_beyond(self.evidence, slopes, self.off_by[id_ in readings, id_ in begun])
            found[id_] = max(found.get(id_, 0.0), self._beyond(i, start, least))
        return found

    @property
    def tolerated(self) -> frozenset[str]:
        """Terms without a name, but for those over time, that exceed in no row what sensors within
        their class and laws within their accuracy allow: they are errors of form of the declared
        size."""
        every = np.concatenate([self.evidence.forms, *self._of_sensors], axis=1)
        allowed = common.NORMAL_95 * np.sqrt(np.sum(every**2, axis=1))
        return frozenset(
            term.name
            for term, moved in self._moved_by_terms
            if term.driver != TIME and np.all(np.abs(moved) <= allowed)
        )

    @property
    def _moved_by_terms(self) -> Iterator[tuple[Term, Array]]:
        """Terms without a name, and their effect on the rows, shape (rows,)."""
        model = self.model
        for term, size in zip(model.terms, model.sizes.terms, strict=True):
            own = model.columns_of(term) - len(model.at)
            yield term, term.columns @ (size * model.forms[own])

    @property
    def shows(self) -> float:
        """Probability that the joined candidates move some output by more than `allowed`."""
        model, allowed = self.model, self.allowed
        if model.terms:
            return 1.0
        slopes = model.point.jacobian * model.table[:, : len(model.at)].any(axis=0)
        shown = (
            self._beyond(i, start, least_beyond(self.evidence, slopes[:, i], allowed))
            for i, _, start in self._amplitudes
        )
        return max(shown, default=0.0)

    @cached_property
    def _amplitudes(self) -> list[tuple[int, str, float]]:
        """Number, id of the explanation and null of each value that has a null."""
        every = (
            (c.id, u, start)
            for c in self.model.setting.joined
            for u, start in amplitudes_of(c).items()
        )
        return [(i, id_, start) for id_, u, start in every for i in indices_of(self.model, u.id)]

    def _beyond(self, i: int, start: float, least: float) -> float:
        """Probability that a value is at least `least` away from its null `start`, SI."""
        model = self.model
        u = np.sqrt(model.covariance[i, i]) / model.prior.coordinates.slopes(model.at)[i]
        ends = np.array([-least, least]) - (model.at[i] - start)
        return 1.0 - float(np.diff(ndtr(ends / u))[0])

    @cached_property
    def off_by(self) -> dict[tuple[bool, bool], dict[str, float]]:
        """Errors of outputs under a complete model, SI, by whether a reading explains them and
        whether they begin.

        The error of a law, at its estimated size, can imitate a permanent effect, and the error of
        a sensor within its class another error of that sensor. A term without a name at a law is an
        error of that law, too.
        """
        evidence, model = self.evidence, self.model
        first, count = len(model.at), evidence.forms.shape[1]
        own, errors = slice(first, first + count), model.forms[:count]
        spread = model.inverse[own, own] + np.outer(errors, errors) + 1e-12 * np.eye(count)
        laws = evidence.forms * model.sizes.of(evidence.law) @ np.linalg.cholesky(spread)
        terms = [m for t, m in self._moved_by_terms if not evidence.of_reading(t.changed)]
        laws, sensors = np.column_stack([laws, *terms]), self._of_sensors
        return {
            (of_sensor, begun): self._allowed(
                *([] if begun else [laws]), *(sensors if of_sensor else ())
            )
            for of_sensor, begun in product((False, True), repeat=2)
        }

    @property
    def allowed(self) -> dict[str, float]:
        """Error of each output that sensors within their class and laws within their accuracy
        explain in 19 of 20 recordings, SI."""
        return self._allowed(self.evidence.forms, *self._of_sensors)

    @property
    def _of_sensors(self) -> tuple[Array, ...]:
        """Rows of sensor errors within their class, shape (rows, errors) each."""
        errors = [i for i, name in enumerate(self.model.prior.names) if name.startswith(ERROR)]
        return self.model.point.jacobian[:, errors], *self.evidence.of_class

    def _allowed(self, *errors: Array) -> dict[str, float]:
        """Largest error of each output in 19 of 20 recordings, SI, by errors of unit size, shape
        (rows, errors) each."""
        every = np.concatenate([np.zeros((self.evidence.count, 0)), *errors], axis=1)
        return {n: common.NORMAL_95 * u for n, u in self.evidence.shown(every).items()}


def least_beyond(evidence: Evidence, slopes: Array, allowed: Mapping[str, float]) -> float:
    """Smallest size that moves some output by more than is `allowed`, SI by output; `slopes`, shape
    (rows,), are those by the size."""
    moved = evidence.shown(slopes[:, None]) if slopes.any() else {}
    return min(
        (allowed.get(name, 0.0) / most for name, most in moved.items() if most > 0.0),
        default=np.inf,
    )
