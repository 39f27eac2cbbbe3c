"""Errors of form in a plant that stores: of the effects' own laws, and of the laws of the plant."""

from collections.abc import Iterator, Mapping

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import TIME, Candidate, DisturbanceLocation
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.evidence.stores.noise import hats
from rulec.mismatch.evidence.stores.simulation_problem import SHOWN, Simulated, SimulationProblem
from rulec.mismatch.evidence.term import bends

# The change by a candidate in a plant that stores, and errors of form of that change: no effect
# obeys its formula exactly.

RATE = "der:"

PREFIXES = {RATE: "balance:", SHOWN: "reading:"}
"""Prefixes of the places at which an error adds to a rate and to a reading."""


def changes(
    problem: SimulationProblem,
    ids: tuple[str, ...],
    values: Mapping[str, float],
    inputs: Mapping[str, Array],
    candidate: Candidate,
) -> dict[str, tuple[Array, Array]]:
    """Rates and readings along the course of a model, and their change by a candidate, both of
    shape (n,), SI, by output."""
    balances = problem.balances(ids)
    course = problem.simulate(ids, values, inputs=inputs).course
    every = {**problem.plain_values, **values, TIME: problem.time}
    given = {n: np.asarray(every[n]) for n in balances.plan.inputs if n in every}
    given |= {n: inputs[n] for n in balances.inputs}
    states = enumerate(balances.states)
    given |= {n: np.ascontiguousarray(course.states[:, i]) for i, n in states}
    off = {u.id: u.null for u in candidate.unknowns if u.null is not None}
    outputs = [n for n in balances.plan.outputs if n.startswith((RATE, SHOWN))]
    plan, found = balances.plan.select(outputs), {}
    here, there = (plan.run({**given, **extra}) for extra in ({}, off))
    for name in outputs:
        # A lag that is switched off at one moment has no rate.
        with np.errstate(all="ignore"):
            change = here[name] - there[name]
        change = np.where(np.isfinite(change), change, 0.0)
        shape = problem.time.shape
        found[name] = np.broadcast_to(here[name], shape), np.broadcast_to(change, shape)
    return found


def forms_of_effects(
    problem: SimulationProblem, joined: tuple[Candidate, ...], values: Mapping[str, float]
) -> Iterator[Array]:
    """Change of readings if the own term of each effect is larger by smooth functions of its
    drivers: stacked, shape (signals * samples,), SI."""
    ids, inputs = tuple(c.id for c in joined), problem.record.inputs
    location_by_id, zero = problem.builder.location_by_id, np.zeros(len(problem.time))
    for candidate in joined:
        drivers = dict.fromkeys(d for d in candidate.drivers.values() if d != TIME)
        courses = [problem.trajectory(ids, values, driver, inputs) for driver in drivers]
        shapes = [shape for course in courses for shape in bends(course)]
        if not shapes:
            continue
        errors = {}
        for name, (_, change) in changes(problem, ids, values, inputs, candidate).items():
            kind = next(k for k in PREFIXES if name.startswith(k))
            location = location_by_id.get(PREFIXES[kind] + name.removeprefix(kind))
            if location is not None and change.any():
                errors[location.id, location.unknown] = change
        locations = tuple(id_ for id_, _ in errors)
        try:
            for shape in (zero, *shapes):
                more = {unknown: change * shape for (_, unknown), change in errors.items()}
                shown = problem.simulate(ids, values, (), {**inputs, **more}, locations).stacked
                if shape is zero:
                    plain = shown
                else:
                    yield shown - plain
        except RanAway:
            continue


# Allowed errors of readings under a complete model, with sensors within their class, laws within
# their accuracy, and everything else refitted.


def allowed(fitted: Fitted) -> dict[str, float]:
    """Largest error of each measured signal in 19 of 20 recordings, SI."""
    problem, fitter, judged = fitted.problem, fitted.fitter, fitted.judged
    _, slopes = fitter.residual(fitted.at, judged)
    flags = judged.flags
    squares: Array = np.sum(judged.drift.moved**2, axis=1)
    for _, moved in errors_of_form(problem, fitted.ids, fitted.values):
        rows = fitter.as_rows(moved, judged)
        left = rows - slopes @ np.linalg.lstsq(slopes, rows, rcond=None)[0]
        own = left[: int(flags.sum())] * judged.weights[flags, None]
        squares[flags] += np.sum(own**2, axis=1)
    parts = np.split(np.where(flags, squares, np.nan), len(problem.signals))
    means = (float(np.nanmean(square)) for square in parts)
    sizes = (common.NORMAL_95 * float(np.sqrt(mean)) for mean in means)
    return dict(zip(problem.signals, sizes, strict=True))


def errors_of_form(
    problem: SimulationProblem, ids: tuple[str, ...], values: Mapping[str, float]
) -> Iterator[tuple[DisturbanceLocation, Array]]:
    """Effects of errors of form of each law on readings, stacked, shape (signals * samples,
    errors), SI; each error covers a part of the range of the law.

    Errors with which the plant runs away are omitted.
    """
    zero = np.zeros(len(problem.time))
    for location in (s for s in problem.builder.laws if s.accuracy):
        plain = _with_error(problem, ids, values, location, zero)
        step = 1e-3 * location.factor
        there = _with_error(problem, ids, values, location, np.full(len(problem.time), step))
        moved_first = (there.course.shown[0] - plain.course.shown[0]) / step
        names = problem.builder.balances(ids, (location.id,)).outputs
        # The value of the law is the flow that at first moves as the error does.
        flows = (i for i, n in enumerate(names) if not n.startswith(SHOWN))
        own = next((i for i in flows if abs(moved_first[i] - 1.0) < 1e-3), None)
        if own is None:
            continue
        value = np.ascontiguousarray(plain.course.shown[:, own])
        share = common.FORM_U * location.accuracy
        moved = [np.zeros(len(problem.signals) * len(zero))]
        for shape in hats(value, 1 + round(1.0 / common.FORM_LENGTH)):
            try:
                there = _with_error(problem, ids, values, location, share * value * shape)
            except RanAway:
                continue
            moved.append(there.stacked - plain.stacked)
        yield location, np.stack(moved, axis=1)


def _with_error(
    problem: SimulationProblem,
    ids: tuple[str, ...],
    values: Mapping[str, float],
    location: DisturbanceLocation,
    error: Array,
) -> Simulated:
    inputs = {**problem.record.inputs, location.unknown: error}
    return problem.simulate(ids, values, inputs=inputs, locations=(location.id,))
