"""The evidence of sets of explanations, by Laplace's approximation, against its integral.

What a refit chooses stays as it chose: noise, sizes of random columns, forms of effects. Random
columns are integrated out exactly where noise is normal, and drawn too where it is not.

Source: Owen 2013, chapters 9 and 17 (importance sampling, quasi-random numbers).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from scipy.special import logsumexp, stdtrit
from scipy.stats import qmc

from rulec.effects.model_builder import ModelBuilder
from rulec.knowledge.parameter_belief import peak_of
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import Evidence
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence
from rulec.mismatch.evidence.steady.operating_state_means import rows_of_states
from rulec.mismatch.evidence.steady.screen import references
from rulec.mismatch.evidence.stores.evidence import StoresEvidence
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.evidence.stores.starting_values import from_afar
from rulec.mismatch.search.refit import Model, refitted
from rulec.mismatch.search.simulated import begun
from tests.runtime.mismatch.dynamic import problems
from tests.runtime.mismatch.made import SLIP, USUAL, Sure, alone, recorded, rows_at, tour, warming

SAMPLES = 512
"""Places at which a density is drawn: the error of an integral stays below 0.15 nats."""

WIDER, FREEDOM = 1.3, 3.0
"""Times that the distribution from which is drawn is as wide as the model's, and its degrees of
freedom: as few as those of what is known of parameters."""


@dataclass(frozen=True)
class Integral:
    """The integral of a model's density over its values and, where they are `drawn`, the numbers of
    its random columns."""

    evidence: Evidence
    model: Model

    @cached_property
    def drawn(self) -> bool:
        return isinstance(self.evidence, SteadyEvidence)

    @cached_property
    def free(self) -> Array:
        """Places of the values that are not held."""
        return np.flatnonzero(self.model.prior.highest > self.model.prior.lowest)

    @cached_property
    def columns(self) -> Array:
        """Random columns, whitened, each of its size, shape (rows, columns)."""
        return self.model.table[:, len(self.model.at) :]

    @cached_property
    def about(self) -> tuple[Array, Array]:
        """Middle, and lower factor of the scales, of the distribution from which is drawn."""
        model, n = self.model, len(self.model.at)
        slopes = self.evidence.whitened(model.point.jacobian[:, self.free], model.noise)
        table = np.concatenate([slopes, self.columns], axis=1)
        kept = np.concatenate([self.free, np.arange(n, len(model.precision))])
        precision = model.precision[np.ix_(kept, kept)]
        normal = table.T @ (table * model.weights[:, None]) + precision
        size, k = np.sqrt(np.diag(normal)), len(self.free)
        covariance = np.linalg.inv(normal / np.outer(size, size)) / np.outer(size, size)
        # Where the model made linear is the most probable, values less their means.
        pull = model.table.T @ (model.weights * model.left)
        whole = model.table.T @ (model.table * model.weights[:, None]) + model.precision
        linear = -np.linalg.solve(whole, pull)
        middle = np.concatenate([model.at[self.free], linear[n:]])
        count = len(middle) if self.drawn else k
        return middle[:count], WIDER * np.linalg.cholesky(covariance[:count, :count])

    def density(self, at: Array, numbers: Array) -> float:
        """Log density of values and numbers, without the constants of normal distributions."""
        evidence, model = self.evidence, self.model
        if np.any(at < model.prior.lowest) or np.any(at > model.prior.highest):
            return -np.inf
        setting = replace(model.setting, values={**model.setting.values, **model.prior.values(at)})
        if isinstance(evidence, StoresEvidence):
            residual = evidence.simulated(setting)[0]
        else:
            assert isinstance(evidence, SteadyEvidence)
            rows = evidence.rows
            residual = rows.errors(rows.system.flows(setting))[0][evidence.open]
        if not np.isfinite(residual).all():
            return -np.inf
        prior = model.prior.near(at).density - 0.5 * float(numbers @ numbers)
        white = evidence.whitened(residual, model.noise)
        if self.drawn:
            return prior + evidence.likelihood(white + self.columns @ numbers, model.noise)
        lower = np.linalg.cholesky(np.eye(self.columns.shape[1]) + self.columns.T @ self.columns)
        gone = np.linalg.solve(lower, self.columns.T @ white)
        size = float(np.sum(np.log(np.diag(lower))))
        return prior + evidence.likelihood(white, model.noise) + 0.5 * float(gone @ gone) - size

    def weight(self, share: Array) -> float:
        """Log density at a place of the unit cube, over that with which it is drawn:
        Student's in each independent direction."""
        middle, factor = self.about
        far = stdtrit(FREEDOM, share)
        drawn = len(far) * float(peak_of(np.array(FREEDOM)) - 0.5 * np.log(2.0 * np.pi))
        drawn -= 0.5 * (FREEDOM + 1.0) * float(np.sum(np.log1p(far**2 / FREEDOM)))
        drawn -= float(np.sum(np.log(np.diag(factor))))
        there, at = middle + factor @ far, self.model.at.copy()
        at[self.free] = there[: len(self.free)]
        density = self.density(at, there[len(self.free) :])
        return density - drawn - 0.5 * len(far) * float(np.log(2.0 * np.pi))

    def sampled(self) -> tuple[float, float]:
        """Log of the integral by importance sampling, and its standard uncertainty, nats."""
        shares = qmc.Sobol(len(self.about[0]), seed=1).random(SAMPLES)
        logs = np.array([self.weight(share) for share in shares])
        mean = float(logsumexp(logs)) - np.log(SAMPLES)
        u = float(np.std(np.exp(logs - mean))) / np.sqrt(SAMPLES)
        odds = self.model.sizes.odds + self.evidence.noise_odds(self.model.noise)
        return mean + odds, u


Values = Mapping[str, Mapping[str, float]]
"""Per candidate its parameters, by local names, SI."""

FILLING, CLOGGING, WIDENING = "A.filling-loss@Q_geo", "A.clogging", "A.widening"
OUTLET, CURVE = "lower.outlet-exponent@outflow", "pump.pump-curve@pump"
ALL = ("A.n", "A.dp", "A.P_el")
WARM = {SLIP: {"b": 0.03, "T0": USUAL}}
STEEP = {OUTLET: {"m": 0.3, "l0": 0.1}}


def knowing(builder: ModelBuilder, *unknown: str, values: Mapping[str, float]) -> Sure:
    """A builder all of whose parameters are known, but for a few: problems stay small."""
    own = builder.parameters
    kept = [own.ids.index(name) for name in unknown]
    stated = dict(zip(own.ids, own.values.tolist(), strict=True))
    closed = {n: v for n, v in {**stated, **values}.items() if n not in unknown}
    few = replace(
        own,
        ids=unknown,
        units=tuple(own.units[i] for i in kept),
        factors=own.factors[kept],
        values=own.values[kept],
        positive=own.positive[kept],
        lowest=own.lowest[kept],
        highest=own.highest[kept],
        covariance=own.covariance[np.ix_(kept, kept)],
        constants={**own.constants, **closed},
        sheet={name: own.sheet[name] for name in unknown},
    )
    return Sure(builder, few)


def whole_names(joined: Values) -> dict[str, dict[str, float]]:
    return {c: {f"{c}.{name}": v for name, v in own.items()} for c, own in joined.items()}


def settled(begin: Values, built: Values, without_error: tuple[str, ...] = ALL) -> Integral:
    rules, builder = alone()
    there = rules, cast(ModelBuilder, knowing(builder, "A.C0", "A.k2", values={}))
    recording = recorded(there, {**tour(rules, 240), "A.T": warming(240)}, built)
    rows = rows_of_states(rows_at(there, recording).system)
    setting = Configuration()
    for name, values in whole_names(begin).items():
        candidate = next(c for c in builder.candidates if c.id == name)
        setting = setting.joining(candidate, values, references(rows.system, candidate))
    evidence = SteadyEvidence(rows, exact=True)
    return Integral(evidence, refitted(evidence, setting, without_error=without_error))


def stores(begin: Values, built: Values) -> Integral:
    rules, builder = problems.tanks()
    unknown = ("pump.k", "upper.a", "upper.h0", "lower.a", "lower.h0")
    more = {n: v for own in whole_names(built).values() for n, v in own.items()}
    record = problems.problem_of(problems.made(150, joined=tuple(built), more=more)).record
    there = cast(ModelBuilder, knowing(builder, *unknown, values=problems.TRUE))
    problem = SimulationProblem(rules, there, record)
    search = begun(problem)
    evidence, plain = search.evidence, search.models[frozenset()]
    assert isinstance(evidence, StoresEvidence)
    setting = plain.setting
    for name, values in whole_names(begin).items():
        candidate = problem.candidate(name)
        setting = setting.joining(candidate, values, evidence.references(setting, candidate))
    if begin:
        plain = refitted(evidence, from_afar(evidence.problem, setting), plain)
    return Integral(evidence, plain)


PROBLEMS: Mapping[str, Callable[[], Integral]] = {
    "settled, nothing joined": lambda: settled({}, {}, ()),
    "settled, an amplitude": lambda: settled({SLIP: {"b": 0.02}}, WARM),
    "settled, a shape": lambda: settled(
        {FILLING: {"k": 0.4, "n_c": 13.0}}, {FILLING: {"k": 0.5, "n_c": 14.0}}
    ),
    "settled, two effects": lambda: settled(
        {SLIP: {"b": 0.02}, CLOGGING: {"x": 0.1}}, {**WARM, CLOGGING: {"x": 0.1}}
    ),
    "settled, pressed to an end": lambda: settled({CLOGGING: {"x": 0.1}}, {WIDENING: {"x": 0.05}}),
    "stores, nothing joined": lambda: stores({}, {}),
    "stores, two effects": lambda: stores(
        {OUTLET: {"m": 0.1}, CURVE: {"b": 0.1}}, {**STEEP, CURVE: {"b": 0.2, "u0": 3.0}}
    ),
}


@pytest.mark.parametrize("name", PROBLEMS)
def test_laplace_finds_the_evidence(name: str) -> None:
    integral = PROBLEMS[name]()
    whole, u = integral.sampled()
    assert abs(integral.model.evidence - whole) < 1.0
    assert u <= 0.15
