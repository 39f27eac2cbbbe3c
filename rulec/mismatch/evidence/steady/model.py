"""A model fitted to settled points, by the interface of answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.model import Line, Model, Pace, Variable, unit_of_size
from rulec.mismatch.evidence.steady.configuration import Course
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.locate import variables_of
from rulec.mismatch.evidence.steady.onset import onset_of
from rulec.mismatch.result import Estimate, Growth, Period

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
            pace=Pace(*limits.STEADY_PACE),
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
        degree, known = self.fitted.setting.values[name], onset_of(self.fitted, course)
        rate, u = HOUR * degree / (span.until - span.since), HOUR * known.u_rate
        far = common.NORMAL_95 * u
        growth = Growth(
            rate=rate, u=u, lower=max(rate - far, 0.0), upper=rate + far, u_since=known.u_since
        )
        return Period(span.since, span.until, degree, known.u_degree, size, growth)

    def term(self, candidate: Candidate) -> Array:
        """Squared change of the residuals by a candidate, summed per point, shape (n,)."""
        fitted, system = self.fitted, self.fitted.rows.system
        without = fitted.setting.leaving(candidate.id)
        modules, at = system.reached(candidate.observers), fitted.predicted
        with_it = system.flows(fitted.setting, modules=modules, at=at).values
        change_of = with_it - system.flows(without, modules=modules, at=at).values
        change = {i: np.nan_to_num(c) for i, c in enumerate(change_of) if np.isfinite(c).any()}
        rows = fitted.rows.column(fitted.maps, change)
        squares = np.bincount(fitted.rows.point, rows**2, len(system.data)).astype(float)
        return np.where(fitted.used, squares, np.nan)

    def variables(self, module: str) -> dict[str, Variable]:
        """Readings of the module, and those that no observer needs."""
        names = variables_of(self.fitted.rows.system, module)
        found = {name: self.variable(name) for name in names}
        return {name: variable for name, variable in found.items() if variable is not None}

    def variable(self, name: str) -> Variable | None:
        """A reading at the settled points."""
        values = self.fitted.rows.system.data.values.get(name)
        derived = self.builder.fluid_drivers.get(name)
        if derived is not None and values is not None:
            return Variable(values, derived.unit.factor, derived.unit.offset, derived.unit.text)
        signal = self.ruleset.signal_by_id.get(name)
        if signal is None or values is None:
            return None
        return Variable(values, signal.factor, signal.offset, signal.unit)


def model_of(fitted: Fitted) -> SteadyModel:
    """The model of a fit, without the degrees of periods among its free values."""
    system = fitted.rows.system
    places = [i for i, name in enumerate(fitted.prior.names) if "#" not in name]
    return SteadyModel(
        ruleset=system.ruleset,
        builder=system.builder,
        samples=system.data,
        joined=fitted.setting.joined,
        free=tuple(fitted.prior.names[i] for i in places),
        covariance=fitted.covariance[np.ix_(places, places)],
        fitted=fitted,
    )
