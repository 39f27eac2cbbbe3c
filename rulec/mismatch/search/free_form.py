"""Last resort: a term without physics behind it, where something is left that no entry names.

Its coefficients have the unit of the place, the readings in it are plain numbers (less their
median, over their spread): any such term is dimensionally legal.

Source: sparse regression by forward selection (Brunton, Proctor, Kutz 2016 for the idea); a curve
over one reading as in generalised additive models (Hastie, Tibshirani 1986).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Spot
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.locate import Suspect, suspects, variables_of
from rulec.mismatch.evidence.steady.screen import (
    InitialCandidate,
    ScoreTest,
    score_tests_at,
    screen,
)


@dataclass(frozen=True)
class Curve:
    """A free curve over one reading at a place; `gain` in log likelihood, linearised, its pieces
    paid for."""

    spot: Spot
    signal: str
    parts: int
    gain: float


def best_curve(fitted: Fitted) -> Curve | None:
    """What a free function of one reading explains at best."""
    looks = score_tests_at(fitted)
    each = 0.5 * float(np.log(max(fitted.rows.groups, 2)))
    curves = []
    for suspect in suspects(fitted)[: limits.CURVE_PLACES]:
        for name in _varying(fitted, suspect.spot.module):
            parts = _parts(fitted, name)
            if parts:
                gain = _curve_gain(fitted, looks, suspect, name, parts) - parts * each
                curves.append(Curve(suspect.spot, name, parts, gain))
    # An error of a reading says the same as one of the law that it is compared with: the law first.
    return max(curves, key=lambda c: (round(c.gain), c.spot.kind == "definition"), default=None)


def _knots(fitted: Fitted, name: str, parts: int) -> Array:
    data = fitted.rows.system.data
    knots: Array = np.nanquantile(data.values[name][data.open], np.linspace(0.0, 1.0, parts + 1))
    return knots


def _parts(fitted: Fitted, name: str) -> int:
    """Pieces of a curve over a reading; 0 where its readings are too near each other.

    Bands within the noise of a reading, as at a few operating points, would sort that noise.
    """
    data = fitted.rows.system.data
    least = limits.BAND_WIDTH * float(np.nanmedian(data.noise[name][data.open]))
    apart = (n for n in limits.BANDS if float(np.min(np.diff(_knots(fitted, name, n)))) >= least)
    return next(apart, 0)


def _curve_gain(
    fitted: Fitted, looks: tuple[ScoreTest, ...], suspect: Suspect, name: str, parts: int
) -> float:
    data, knots = fitted.rows.system.data, _knots(fitted, name, parts)
    known = np.nan_to_num(data.values[name], nan=float(np.nanmedian(data.values[name][data.open])))
    bands: Array = np.stack([np.interp(known, knots, row) for row in np.eye(len(knots))], 1)
    # All of them together are a constant, which base values may hold.
    bands = np.delete(bands, parts // 2, axis=1)
    columns = suspect.column[:, None] * bands[fitted.rows.point]
    wide = np.full(columns.shape[1], np.inf)
    return max(look.best(columns, -wide, wide)[1] for look in looks)


def free_form_trials(fitted: Fitted) -> list[InitialCandidate]:
    """The best terms at the most suspect places; none where no reading says anything."""
    builder, curve = fitted.rows.system.builder, best_curve(fitted)
    drawn = []
    if curve is not None and curve.gain > 0:
        pieces = [i for i in range(curve.parts + 1) if i != curve.parts // 2]
        features = tuple(f"{curve.signal}~{i}/{curve.parts}" for i in pieces)
        drawn = screen(fitted, [builder.free_form(curve.spot.id, features)])
    return [*drawn, *_products(fitted)]


def _products(fitted: Fitted) -> list[InitialCandidate]:
    """A few products of readings, chosen one by one."""
    found = suspects(fitted)
    if not found:
        return []
    spot, builder = found[0].spot, fitted.rows.system.builder
    features = _features(fitted, spot.module)
    chosen: tuple[str, ...] = ()
    best: InitialCandidate | None = None
    while len(chosen) < limits.MOST_FEATURES:
        more = [(*chosen, f) for f in features if f not in chosen]
        trials = screen(fitted, [builder.free_form(spot.id, m) for m in more])
        if not trials or (best is not None and trials[0].gain < limits.FEATURE_GAINS * best.gain):
            break
        best = trials[0]
        chosen = next(m for m in more if builder.free_form(spot.id, m) == best.candidate)
    return [best] if best is not None else []


def _features(fitted: Fitted, module: str) -> list[str]:
    """Readings that vary, their squares and products."""
    names = _varying(fitted, module)[: limits.MOST_READINGS]
    pairs = itertools.combinations_with_replacement(names, 2)
    return [*names, *(f"{a}*{b}" for a, b in pairs)]


def _varying(fitted: Fitted, module: str) -> list[str]:
    """Readings that vary by more than their noise; what follows from others explains nothing."""
    data = fitted.rows.system.data
    outputs = {name for cell in fitted.rows.cells for name in cell.outputs}
    names = []
    for name, values in variables_of(fitted.rows.system, module).items():
        noise = data.noise.get(name)
        spread = float(np.nanstd(values[data.open]))
        if (
            name not in outputs
            and noise is not None
            and spread > limits.FEATURE_VARIES * float(np.nanmedian(noise))
        ):
            names.append(name)
    return names
