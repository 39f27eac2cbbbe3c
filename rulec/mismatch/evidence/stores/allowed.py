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
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem


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
    for spot in (s for s in bench.builder.spots if s.accuracy):
        value = bench.trajectory(fitted.ids, fitted.values, f"{spot.module}.{spot.place}", {})
        u = common.FORM_U * spot.accuracy * value
        knots = np.linspace(value.min(), value.max(), 1 + round(1.0 / common.FORM_LENGTH))
        for part in np.eye(len(knots)):
            shape = np.interp(value, knots, part)
            try:
                yield _shown(bench, fitted, spot, u * shape) - _shown(bench, fitted, spot, 0.0 * u)
            except RanAway:
                continue


def _shown(bench: SimulationProblem, fitted: Fitted, spot: Spot, error: Array) -> Array:
    inputs = {**fitted.inputs, spot.unknown: error}
    said = bench.simulate(fitted.ids, fitted.values, inputs=inputs, spots=(spot.id,))
    return np.concatenate([said.shown[n] for n in bench.signals])
