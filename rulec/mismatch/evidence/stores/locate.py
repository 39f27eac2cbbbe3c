"""Locate a mismatch: every balance and every sensor in turn gets an error with a free course.

The course has values over time with a common prior, whose size makes the errors of the model most
likely. A place is suspect by what its error explains.

Source: noise terms on state equations point at the deficient one (Kristensen, Madsen, Jorgensen
2004); here as a smoothed input, by linear response.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import DisturbanceLocation
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.stores.fit import Fitted, Judged
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem

STORED = ("balance", "reading")


@dataclass(frozen=True)
class Suspect:
    """A place with the course of its error, SI, shape (n,); `gain` in log likelihood.

    `share` is the part of the squared errors that it explains.
    """

    spot: DisturbanceLocation
    course: Array
    gain: float
    share: float


def suspects(bench: SimulationProblem, fitted: Fitted, judged: Judged) -> list[Suspect]:
    """Places by what an error there explains, the likeliest first."""
    flags = judged.flags()
    weight = np.repeat([fitted.noise[n].weight for n in bench.signals], len(bench.time))[flags]
    left = np.concatenate([fitted.errors[n] for n in bench.signals])[flags] / weight
    found: list[Suspect] = []
    for knots in common.COURSE_KNOTS:
        found = []
        for spot in (s for s in bench.builder.spots if s.kind in STORED):
            answer = response(bench, fitted, spot, knots)
            if answer is not None:
                columns, shapes, size = answer
                found.append(_suspect(spot, columns[flags] / weight[:, None], shapes, size, left))
        found.sort(key=lambda s: -s.gain)
        # The smoothest course that suffices says most about its place.
        if found and found[0].share > limits.SMOOTH_ENOUGH:
            break
    return found


def response(
    bench: SimulationProblem, fitted: Fitted, spot: DisturbanceLocation, knots: int
) -> tuple[Array, list[Array], float] | None:
    """Effects of unit errors at a place on all readings, stacked, with the shapes of the errors and
    the unit, SI; None where there is no effect.

    A constant unit error moves readings by their scatter.
    """

    def shown(course: Array) -> Array:
        inputs = {**fitted.inputs, spot.unknown: course}
        return bench.simulate(fitted.ids, fitted.values, inputs=inputs, spots=(spot.id,)).stacked

    scatter = max(float(np.nanstd(v)) for v in bench.record.measured.values())
    zero = np.zeros(len(bench.time))
    try:
        plain = shown(zero)
        size = 1e-6 * spot.factor
        moved = float(np.nanmax(np.abs(shown(zero + size) - plain)))
        if moved <= 1e-12 * scatter:
            return None
        size *= scatter / moved
        ends = np.linspace(bench.time[0], bench.time[-1], max(knots, 2))
        shapes = [np.interp(bench.time, ends, row) for row in np.eye(len(ends))[:knots]]
        step = 0.02 * size
        columns = [(shown(step * shape) - plain) / 0.02 for shape in shapes]
    except RanAway:
        return None
    return np.column_stack(columns), shapes, size


def _suspect(
    spot: DisturbanceLocation, columns: Array, shapes: list[Array], size: float, left: Array
) -> Suspect:
    """The error of the likeliest size, and its course."""
    basis, lengths, turned = np.linalg.svd(columns, full_matrices=False)
    inside = basis.T @ left
    best: tuple[float, float] = (0.0, 0.0)
    for scale in np.logspace(*limits.COURSE_SIZES):
        spread = 1.0 + (scale * lengths) ** 2
        gain = 0.5 * float(np.sum(inside**2 * (1.0 - 1.0 / spread)) - np.sum(np.log(spread)))
        if gain > best[0]:
            best = (gain, float(scale))
    gain, scale = best
    pull = scale**2 * lengths / (1.0 + (scale * lengths) ** 2)
    course = np.asarray(-(turned.T @ (pull * inside)))
    explained = left + columns @ course
    share = 1.0 - float(np.sum(explained**2) / max(np.sum(left**2), 1e-300))
    whole = np.sum([c * s for c, s in zip(course, shapes, strict=True)], axis=0)
    return Suspect(spot, whole * size, gain, max(share, 0.0))
