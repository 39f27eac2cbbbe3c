"""A model fitted to settled points, by the interface of answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.steady.observe import reason
from rulec_runtime.recordings.recording import Recording

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Course
from rulec.mismatch.evidence.model import (
    HELD_OUT,
    HELDOUT,
    SEARCHED,
    Line,
    Model,
    Variable,
    counted_rows,
    unit_of_size,
    unread,
)
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.prepare import SPARED, Data
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import change_by, variables_of
from rulec.mismatch.result import Estimate, Evidence, Growth, Period

UNSETTLED = "not settled"
TOO_MANY = "settled, of which only a part is taken as there are so many"
NOTHING_TO_COMPARE = "no two estimates of one flow can be compared there"


def evidence_of(
    recording: Recording,
    data: Data | None,
    rows: Rows | None = None,
    judged: np.ndarray | None = None,
    faulty: np.ndarray | None = None,
) -> tuple[Evidence, ...]:
    """Count the rows of a recording of a plant that has to settle.

    Parameters
    ----------
    data : None where nothing is settled.
    rows : None where no point could be compared.
    judged, faulty : points in the errors of the proof, and in periods of faults, shape (n,); None
        where nothing was proven.
    """
    unused, used = unread(recording), list[str]()
    if data is None:
        return counted_rows((), [*unused, *[UNSETTLED] * len(recording)])
    compared = np.isin(np.arange(len(data)), () if rows is None else rows.group_point)
    texts = [_why_not(rows, point) for point in range(len(data))]
    for point in np.flatnonzero(compared).tolist():
        what, why = HELD_OUT if data.part[point] == HELDOUT else SEARCHED, texts[point]
        if faulty is not None and faulty[point]:
            what += ", in a period of a fault, so not in the errors"
        elif judged is not None and not judged[point]:
            what += ", not in the errors, as no reading is predicted there"
        texts[point] = f"{what} ({why})" if why else what
    for point in data.sample.tolist():
        if point < 0:
            unused.append(TOO_MANY if point == SPARED else UNSETTLED)
        else:
            (used if compared[point] else unused).append(texts[point] or NOTHING_TO_COMPARE)
    return counted_rows(used, unused)


def _why_not(rows: Rows | None, point: int) -> str:
    """Why the first unusable estimate at a point is unusable; empty where all are usable."""
    if rows is None or not rows.system.observers:
        return ""
    system = rows.system
    for number in np.flatnonzero(~system.valid[:, point]).tolist():
        spec = system.observers[number]
        moving = system.data.moving.get(spec.module)
        if moving is not None and moving[point]:
            return f"{spec.module} is not settled"
        index = system.ruleset.observer_index[spec.id]
        return reason(system.ruleset, system.observed, index, point)
    return ""


class Onset(NamedTuple):
    """Standard uncertainties of the final degree of a growing fault, of its onset, s, and of its
    rate, 1/s, and the Gauss-Newton `step` of the onset, s."""

    u_degree: float
    u_since: float
    u_rate: float
    step: float


def onset_of(fitted: Fitted, course: Course) -> Onset:
    """Linearise degree and onset together, with all other values refitted.

    The residuals have a kink at the onset and depend on it smoothly elsewhere, so it has a slope
    like any other value. With the onset held, rate and degree would seem too certain: a later
    onset needs a higher rate.
    """
    (span,), (name,), risen = course.periods, course.names(), course.risen
    assert risen is not None
    at, time, point = (
        fitted.prior.names.index(name),
        fitted.rows.system.data.time,
        fitted.rows.point,
    )
    value, length, prior = fitted.setting.values[name], span.until - span.since, fitted.local_prior
    # The slope of the degree, by the share reached, is that of a fault that is there at once.
    by_onset = np.where(risen > 0.0, (time - span.until) / length**2, 0.0)
    whole = fitted.jacobian[:, at] / np.where(risen > 0.0, risen, 1.0)[point]
    table = np.column_stack([fitted.jacobian, value * whole * by_onset[point]])
    half = table * np.sqrt(fitted.weights)[:, None]
    normal = half.T @ half
    normal[:-1, :-1] += prior.precision
    normal[-1, -1] += 1e-12 / length**2
    gradient = table.T @ (fitted.weights * fitted.residual)
    gradient[:-1] += prior.precision @ (fitted.at - prior.mean)
    size = np.sqrt(np.diag(normal))
    inverse = np.linalg.pinv(normal / np.outer(size, size), hermitian=True) / np.outer(size, size)
    both = inverse[np.ix_([at, -1], [at, -1])]
    by_both = np.array([1.0 / length, value / length**2])
    u_degree, u_since = np.sqrt(np.diag(both)).tolist()
    u_rate = float(np.sqrt(by_both @ both @ by_both))
    return Onset(u_degree, u_since, u_rate, step=-float(inverse[-1] @ gradient))


HOUR = 3600.0


@dataclass(frozen=True, kw_only=True)
class SteadyModel(Model):
    """Errors in variables at settled points."""

    fitted: Fitted

    def line(self, name: str) -> Line:
        """All other values refitted, with the correlation of neighbours taken into account."""
        fitted, prior = self.fitted, self.fitted.prior
        i, value, u = prior.names.index(name), fitted.setting.values[name], fitted.u(name)
        of_fit = fitted.rows, fitted.setting, fitted.used, limits.HELD_STEPS

        def fall(step: float) -> float:
            there = fit(*of_fit, {name: value + step}, fitted.variance_inflation)
            return there.objective - fitted.objective

        return Line(
            value=value,
            u=u,
            least=u,
            lowest=float(prior.lowest[i]),
            highest=float(prior.highest[i]),
            fall=fall,
        )

    def periods(
        self, candidate: Candidate, estimates: Mapping[str, Estimate]
    ) -> tuple[Period, ...]:
        """Periods of a fault that comes and goes, or the one in which it grew."""
        unknowns = {u.id: u for u in candidate.unknowns}
        found = []
        for course in self.fitted.setting.courses:
            if course.unknown not in unknowns:
                continue
            size = unit_of_size(unknowns[course.unknown])
            if course.grows:
                found.append(self._growing(course, size))
                continue
            for span in course.periods:
                name = course.names()[span.level]
                degree, u = self.fitted.setting.values[name], self.fitted.u(name)
                found.append(Period(span.since, span.until, degree, u, size))
        return tuple(found)

    def _growing(self, course: Course, size: str) -> Period:
        (span,), (name,) = course.periods, course.names()
        degree, onset = self.fitted.setting.values[name], onset_of(self.fitted, course)
        rate, u = HOUR * degree / (span.until - span.since), HOUR * onset.u_rate
        far = common.NORMAL_95 * u
        growth = Growth(
            rate=rate, u=u, lower=max(rate - far, 0.0), upper=rate + far, u_since=onset.u_since
        )
        return Period(span.since, span.until, degree, onset.u_degree, size, growth)

    def term(self, candidate: Candidate) -> Array:
        """Squared change of the residuals by a candidate, summed per point, shape (n,)."""
        fitted, system = self.fitted, self.fitted.rows.system
        rows = fitted.rows.column(fitted.maps, change_by(fitted, candidate))
        squares = np.bincount(fitted.rows.point, rows**2, len(system.data)).astype(float)
        return np.where(fitted.used, squares, np.nan)

    def variables(self, module: str) -> dict[str, Variable]:
        """Readings of the module, and those that no observer needs."""
        names = variables_of(self.fitted.rows.system, module)
        return {name: own for name in names if (own := self.variable(name)) is not None}

    def variable(self, name: str) -> Variable | None:
        """A reading at the settled points."""
        values = self.fitted.rows.system.data.values.get(name)
        derived, signal = self.builder.fluid_drivers.get(name), self.ruleset.signal_by_id.get(name)
        if derived is not None and values is not None:
            return Variable(values, derived.unit.factor, derived.unit.offset, derived.unit.text)
        return None if signal is None or values is None else Variable.of(values, signal)


def model_of(fitted: Fitted) -> SteadyModel:
    """The model of a fit, without the degrees of periods among its free values."""
    system = fitted.rows.system
    indices = [i for i, name in enumerate(fitted.prior.names) if "#" not in name]
    return SteadyModel(
        ruleset=system.ruleset,
        builder=system.builder,
        samples=system.data,
        joined=fitted.setting.joined,
        free=tuple(fitted.prior.names[i] for i in indices),
        covariance=fitted.covariance[np.ix_(indices, indices)],
        fitted=fitted,
    )
