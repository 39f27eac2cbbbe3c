"""A fitted model of a plant that stores, by the interface of answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.model import Line, Model, Variable, unit_of_size
from rulec.mismatch.evidence.stores.errors_of_form import changes
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.result import Estimate, Period


@dataclass(frozen=True, kw_only=True)
class StoresModel(Model):
    """Output error of a simulation."""

    fitted: Fitted

    @property
    def problem(self) -> SimulationProblem:
        """The plant and its recording."""
        return self.fitted.problem

    def line(self, name: str) -> Line:
        """All other values refitted, from their current values and from their linear response."""
        fitted, fitter, judged = self.fitted, self.fitted.fitter, self.fitted.judged
        at, i, prior = fitted.at, fitted.free.index(name), fitter.prior
        along = fitted.covariance[:, i] / fitted.covariance[i, i] / prior.coordinates.slopes(at)
        bottom = fitter.cost(at, judged)
        return Line(
            value=float(at[i]),
            u=fitted.u(name),
            least=0.0,
            lowest=float(prior.lowest[i]),
            highest=float(prior.highest[i]),
            fall=lambda step: fitter.fall(at, i, step, along, judged) - bottom,
        )

    def periods(
        self, candidate: Candidate, estimates: Mapping[str, Estimate]
    ) -> tuple[Period, ...]:
        """A fault that begins lasts to the end."""
        return period_of(self.problem, candidate, estimates)

    def term(self, candidate: Candidate) -> Array:
        """Squared change of balances and readings by a candidate along the repaired course, each
        over its scatter, shape (n,).

        Zero where the candidate itself stores something and cannot be switched off at one moment.
        """
        own = self.fitted
        found = changes(self.problem, own.ids, own.values, own.inputs, candidate)
        total = np.zeros(len(self.problem.time))
        for here, change in found.values():
            scatter, size = float(np.nanstd(here)), float(np.nanmax(np.abs(here)))
            if scatter > 1e-12 * size:
                total += (change / scatter) ** 2
        return total

    @cached_property
    def _courses(self) -> dict[str, Variable]:
        signals, dynamics = self.ruleset.signal_by_id, self.ruleset.dynamics
        assert dynamics is not None
        inputs = self.problem.record.inputs.items()
        states = {s.id: Variable.of(self.fitted.course(s.id), s) for s in dynamics.states}
        return {**states, **{name: Variable.of(own, signals[name]) for name, own in inputs}}

    def variables(self, module: str) -> dict[str, Variable]:
        """States of the plant, and inputs."""
        found = self._courses
        own = {n: v for n, v in found.items() if n.partition(".")[0] == module}
        return {**own, **found}

    def variable(self, name: str) -> Variable | None:
        """A state, an input or a measured reading."""
        measured = self.problem.record.measured.get(name)
        if measured is None:
            return self._courses.get(name)
        return Variable.of(measured, self.ruleset.signal_by_id[name])


def model_of(fitted: Fitted) -> StoresModel:
    """The model of a fit."""
    problem = fitted.problem
    return StoresModel(
        ruleset=problem.ruleset,
        builder=problem.builder,
        samples=problem.record,
        joined=fitted.joined,
        free=fitted.free,
        covariance=fitted.covariance,
        fitted=fitted,
    )


def period_of(
    problem: SimulationProblem, candidate: Candidate, estimates: Mapping[str, Estimate]
) -> tuple[Period, ...]:
    """The period of a fault that begins, and its degree."""
    onset = candidate.onset
    degree = next((u for u in candidate.unknowns if u.null is not None), None)
    if onset is None or degree is None:
        return ()
    first, last = (float(t) for t in problem.record.time[[0, -1]])
    found = estimates[degree.name]
    since = first + estimates[onset.name].value
    value, u = found.value * degree.factor, found.u * degree.factor
    return (Period(since, last, value, u, unit_of_size(degree)),)
