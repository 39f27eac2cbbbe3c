"""Benches for tests: recordings that the compiled model made, with noise and something left out."""

import functools
from collections.abc import Mapping

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.evidence.stores.fit import Fitted, plain_end, refit
from rulec.mismatch.evidence.stores.model import model_of
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem, record_of
from rulec.mismatch.search.grow_sets import Search, grow_terms, join_columns
from rulec.mismatch.search.simulated import Found, begun
from rulec.mismatch.stores import Explanation, explanation
from tests.conftest import ROOT
from tests.runtime.sheets import sampled

STEP = 4.0
NOISE = 0.01
OVERFLOW = "upper.overflow-caught@inflow"
TRUE = {
    "pump.k": 2.4e-6,
    "upper.A": 14.8e-4,
    "upper.a": 4.2e-6,
    "upper.h0": 0.08,
    "lower.A": 15.3e-4,
    "lower.a": 4.6e-6,
    "lower.g": 46.0,
    "lower.y0": 0.05,
    "lower.h0": 0.11,
}
"""Another plant than the one that is shipped, within what is stated of it; SI."""

RIM = {f"{OVERFLOW}.k": 60.0, f"{OVERFLOW}.l_o": 0.16, f"{OVERFLOW}.f": 0.7, f"{OVERFLOW}.q0": 8e-6}


@functools.cache
def tanks() -> tuple[Ruleset, ModelBuilder]:
    """Two open tanks, one above the other; only the lower level is measured."""
    return open_builder(ROOT / "plants" / "cascaded-tanks")


def voltage(n: int, seed: int) -> Array:
    """Random steps, each held for 10 to 40 samples, V."""
    random = np.random.default_rng(seed)
    steps = random.uniform(1.0, 5.5, n)
    return np.repeat(steps, random.integers(10, 40, n))[:n]


def made(
    n: int = 512,
    seed: int = 1,
    joined: tuple[str, ...] = (),
    more: Mapping[str, float] | None = None,
    errors: Mapping[str, Array] | None = None,
) -> Recording:
    """A recording of the tanks, with candidates built in and their values.

    `errors` are courses by the location at which they act, in SI.
    """
    _, builder = tanks()
    u, time = voltage(n, seed), STEP * np.arange(n)
    courses = errors or {}
    balances = builder.balances(joined, tuple(courses))
    inputs = np.column_stack([u, *courses.values()])
    base = builder.parameters
    values = {**dict(zip(base.ids, base.values, strict=True)), **base.constants, **TRUE}
    values |= more or {}
    course = balances.run(time, inputs, np.ones(inputs.shape[1], dtype=bool), values)
    y = course.shown[:, balances.outputs.index("shown:lower.y")]
    y = np.clip(y + NOISE * np.random.default_rng(seed + 100).standard_normal(n), 0.0, 10.0)
    shown = {"pump.u": u, "lower.y": np.round(y, 3)}
    return sampled(shown, time, missing=("upper.y",))


def problem_of(recording: Recording) -> SimulationProblem:
    ruleset, builder = tanks()
    record = record_of(recording, ruleset, builder.given)
    return SimulationProblem(ruleset, builder, record)


def joined_to(
    problem: SimulationProblem, name: str, values: Mapping[str, float]
) -> tuple[Fitted, Fitted]:
    """The plain model and one with a candidate, fitted from some values of that."""
    plain = plain_end(problem, {})
    return plain, refit(plain, (problem.candidate(name),), {**plain.values, **values})


def grow_by(search: Search, *names: str) -> None:
    """Refit the plain model with some candidates, and with pairs of them."""
    candidates = [c for c in search.evidence.candidates if c.id in names]
    columns = search.evidence.columns(search.models[frozenset()].point, candidates)
    join_columns(search, frozenset(), columns)


def searched(problem: SimulationProblem, *names: str) -> Found:
    """What a search finds that knows only some names, and terms without one."""
    search = begun(problem)
    grow_by(search, *names)
    grow_terms(search, frozenset())
    plain = plain_end(problem, search.models[frozenset()].setting.values)
    return Found(plain, plain, (), search.posterior())


def as_found(plain: Fitted, best: Fitted) -> Found:
    """Models as if a search had found them, which has tried nothing else."""
    return Found(plain, best, (), begun(plain.problem).posterior())


def explained(recording: Recording, plain: Fitted, best: Fitted) -> Explanation:
    return explanation(recording, model_of(best), as_found(plain, best))
