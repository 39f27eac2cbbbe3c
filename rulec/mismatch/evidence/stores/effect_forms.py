"""The change by a candidate in a plant that stores, and errors of form of that change: no effect
obeys its formula exactly."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import TIME, Candidate
from rulec.mismatch.evidence.stores.simulation_problem import SHOWN, SimulationProblem

RATE = "der:"

SPOTS = {RATE: "balance:", SHOWN: "reading:"}
"""Prefixes of the places at which an error adds to a rate and to a reading."""


def changes(
    bench: SimulationProblem,
    ids: tuple[str, ...],
    values: Mapping[str, float],
    inputs: Mapping[str, Array],
    candidate: Candidate,
) -> dict[str, tuple[Array, Array]]:
    """Rates and readings along the course of a model, and their change by a candidate, both of
    shape (n,), SI, by output."""
    balances = bench.balances(ids)
    course = bench.simulate(ids, values, inputs=inputs).course
    every = {**bench.plain_values, **values, TIME: bench.time}
    known = {n: np.asarray(every[n]) for n in balances.plan.inputs if n in every}
    known |= {n: inputs[n] for n in balances.inputs}
    states = enumerate(balances.states)
    known |= {n: np.ascontiguousarray(course.states[:, i]) for i, n in states}
    off = {u.id: u.null for u in candidate.unknowns if u.null is not None}
    outputs = [n for n in balances.plan.outputs if n.startswith((RATE, SHOWN))]
    plan, found = balances.plan.select(outputs), {}
    here, there = (plan.run({**known, **extra}) for extra in ({}, off))
    for name in outputs:
        # A lag that is switched off at one moment has no rate.
        with np.errstate(all="ignore"):
            change = here[name] - there[name]
        change = np.where(np.isfinite(change), change, 0.0)
        shape = bench.time.shape
        found[name] = np.broadcast_to(here[name], shape), np.broadcast_to(change, shape)
    return found


def forms_of_effects(
    bench: SimulationProblem, joined: tuple[Candidate, ...], values: Mapping[str, float]
) -> Iterator[Array]:
    """Change of readings if the own term of each effect is larger by smooth functions of its
    drivers: stacked, shape (signals * samples,), SI."""
    ids, inputs = tuple(c.id for c in joined), bench.record.inputs
    places, zero = bench.builder.places, np.zeros(len(bench.time))
    for candidate in joined:
        drivers = dict.fromkeys(d for d in candidate.drivers.values() if d != TIME)
        courses = [bench.trajectory(ids, values, driver, inputs) for driver in drivers]
        shapes = [shape for course in courses for shape in bends(course)]
        if not shapes:
            continue
        errors = {}
        for name, (_, change) in changes(bench, ids, values, inputs, candidate).items():
            kind = next(k for k in SPOTS if name.startswith(k))
            spot = places.get(SPOTS[kind] + name.removeprefix(kind))
            if spot is not None and change.any():
                errors[spot.id, spot.unknown] = change
        spots = tuple(id_ for id_, _ in errors)
        try:
            for shape in (zero, *shapes):
                more = {unknown: change * shape for (_, unknown), change in errors.items()}
                shown = bench.simulate(ids, values, inputs={**inputs, **more}, spots=spots).stacked
                if shape is zero:
                    plain = shown
                else:
                    yield shown - plain
        except RanAway:
            continue


def bends(driver: Array) -> tuple[Array, ...]:
    """A parabola and a cubic over the range of a driver, of unit size."""
    low, high = np.quantile(driver, [0.02, 0.98])
    if high <= low:
        return ()
    z = np.clip(2.0 * (driver - low) / (high - low) - 1.0, -1.2, 1.2)
    return np.sqrt(5.0) * (3.0 * z**2 - 1.0) / 4.0, np.sqrt(7.0) * (5.0 * z**3 - 3.0 * z) / 4.0
