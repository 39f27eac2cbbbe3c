"""How far readings may be off with nothing missing: sensors within their class, laws within their
accuracy, everything else refitted beside those."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import Spot
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.stores.fit import Fitted, Fitter, Judged
from rulec.mismatch.evidence.stores.simulation_problem import SHOWN, Simulated, SimulationProblem


def allowed(
    bench: SimulationProblem, fitted: Fitted, kept: Mapping[str, float], judged: Judged
) -> dict[str, float]:
    """Error of each measured signal that is explained in 19 of 20 recordings, SI.

    `kept` are values that stay, SI by id.
    """
    fitter = Fitter(bench, fitted.joined, kept)
    _, slopes = fitter.residual(fitter.vector(fitted.values), judged, judged.basis())
    flags, squares = judged.flags(), np.sum(judged.drift.moved**2, axis=1)
    for moved in _forms(bench, fitted):
        rows = fitter.as_rows(moved[:, None], judged, judged.basis())[:, 0]
        left = rows - slopes @ np.linalg.lstsq(slopes, rows, rcond=None)[0]
        squares[flags] += (left[: int(flags.sum())] * judged.weights()[flags]) ** 2
    own = np.split(np.where(flags, squares, np.nan), len(bench.signals))
    means = (float(np.nanmean(square)) for square in own)
    sizes = (common.NORMAL_95 * float(np.sqrt(mean)) for mean in means)
    return dict(zip(bench.signals, sizes, strict=True))


def _forms(bench: SimulationProblem, fitted: Fitted) -> Iterator[Array]:
    """What errors of form do to readings, stacked, shape (signals * samples,), SI, each of a law
    over a part of its range; none where the plant runs away with it."""
    zero = np.zeros(len(bench.time))
    for spot in (s for s in bench.builder.laws if s.accuracy):
        plain = _with_error(bench, fitted, spot, zero)
        value = _value(bench, fitted, spot, plain)
        if value is None:
            continue
        knots = np.linspace(value.min(), value.max(), 1 + round(1.0 / common.FORM_LENGTH))
        for part in np.eye(len(knots)):
            error = common.FORM_U * spot.accuracy * value * np.interp(value, knots, part)
            try:
                there = _with_error(bench, fitted, spot, error)
            except RanAway:
                continue
            yield np.concatenate([there.shown[n] - plain.shown[n] for n in bench.signals])


def _value(bench: SimulationProblem, fitted: Fitted, spot: Spot, plain: Simulated) -> Array | None:
    """What a law says, shape (n,), SI: the flow that at first moves as its error does."""
    step = 1e-3 * spot.factor
    there = _with_error(bench, fitted, spot, np.full(len(bench.time), step))
    moved = (there.course.shown[0] - plain.course.shown[0]) / step
    names = bench.builder.balances(fitted.ids, (spot.id,)).outputs
    flows = (i for i, n in enumerate(names) if not n.startswith(SHOWN))
    own = next((i for i in flows if abs(moved[i] - 1.0) < 1e-3), None)
    return None if own is None else np.ascontiguousarray(plain.course.shown[:, own])


def _with_error(bench: SimulationProblem, fitted: Fitted, spot: Spot, error: Array) -> Simulated:
    inputs = {**fitted.inputs, spot.unknown: error}
    return bench.simulate(fitted.ids, fitted.values, inputs=inputs, spots=(spot.id,))
