"""Allowed errors of readings under a complete model, with sensors within their class, laws within
their accuracy, and everything else refitted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import DisturbanceLocation
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.drift import hats
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.simulation_problem import SHOWN, Simulated, SimulationProblem


def allowed(
    bench: SimulationProblem, fitted: Fitted, kept: Mapping[str, float], judged: Judged
) -> dict[str, float]:
    """Largest error of each measured signal in 19 of 20 recordings, SI; `kept` are fixed values, SI
    by id."""
    fitter = Fitter(bench, fitted.joined, kept)
    _, slopes = fitter.residual(fitter.vector(fitted.values), judged, judged.basis())
    flags = judged.flags()
    squares: Array = np.sum(judged.drift.moved**2, axis=1)
    for _, moved in errors_of_form(bench, fitted.ids, fitted.values):
        rows = fitter.as_rows(moved, judged, judged.basis())
        left = rows - slopes @ np.linalg.lstsq(slopes, rows, rcond=None)[0]
        own = left[: int(flags.sum())] * judged.weights()[flags, None]
        squares[flags] += np.sum(own**2, axis=1)
    parts = np.split(np.where(flags, squares, np.nan), len(bench.signals))
    means = (float(np.nanmean(square)) for square in parts)
    sizes = (common.NORMAL_95 * float(np.sqrt(mean)) for mean in means)
    return dict(zip(bench.signals, sizes, strict=True))


def errors_of_form(
    bench: SimulationProblem, ids: tuple[str, ...], values: Mapping[str, float]
) -> Iterator[tuple[DisturbanceLocation, Array]]:
    """Effects of errors of form of each law on readings, stacked, shape (signals * samples,
    errors), SI; each error covers a part of the range of the law.

    Errors with which the plant runs away are omitted.
    """
    zero = np.zeros(len(bench.time))
    for spot in (s for s in bench.builder.laws if s.accuracy):
        plain = _with_error(bench, ids, values, spot, zero)
        step = 1e-3 * spot.factor
        there = _with_error(bench, ids, values, spot, np.full(len(bench.time), step))
        moved_first = (there.course.shown[0] - plain.course.shown[0]) / step
        names = bench.builder.balances(ids, (spot.id,)).outputs
        # The value of the law is the flow that at first moves as the error does.
        flows = (i for i, n in enumerate(names) if not n.startswith(SHOWN))
        own = next((i for i in flows if abs(moved_first[i] - 1.0) < 1e-3), None)
        if own is None:
            continue
        value = np.ascontiguousarray(plain.course.shown[:, own])
        share = common.FORM_U * spot.accuracy
        moved = [np.zeros(len(bench.signals) * len(zero))]
        for shape in hats(value, 1 + round(1.0 / common.FORM_LENGTH)):
            try:
                there = _with_error(bench, ids, values, spot, share * value * shape)
            except RanAway:
                continue
            moved.append(there.stacked - plain.stacked)
        yield spot, np.stack(moved, axis=1)


def _with_error(
    bench: SimulationProblem,
    ids: tuple[str, ...],
    values: Mapping[str, float],
    spot: DisturbanceLocation,
    error: Array,
) -> Simulated:
    inputs = {**bench.record.inputs, spot.unknown: error}
    return bench.simulate(ids, values, inputs=inputs, spots=(spot.id,))
