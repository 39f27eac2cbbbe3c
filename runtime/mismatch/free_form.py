"""Last resort: a term without physics behind it, where something is left that no entry names.

Its coefficients have the unit of the place, the readings in it are plain numbers (less their
median, over their spread): any such term is dimensionally legal.

Source: sparse regression by forward selection (Brunton, Proctor, Kutz 2016 for the idea).
"""

from __future__ import annotations

import itertools

import numpy as np

from runtime.mismatch.fit import Fitted
from runtime.mismatch.locate import suspects, variables_of
from runtime.mismatch.screen import Trial, screen

MOST_FEATURES = 3
"""Products of readings in a term."""

MOST_READINGS = 5
"""Readings of which products are made."""

VARYING = 5.0
"""A reading says something if it varies by this many times its noise."""


def free_form_trials(fitted: Fitted) -> list[Trial]:
    """The best term at the most suspect place; none where no reading says anything."""
    found = suspects(fitted)
    if not found:
        return []
    spot, workshop = found[0].spot, fitted.rows.system.workshop
    features = _features(fitted, spot.module)
    chosen: tuple[str, ...] = ()
    best: Trial | None = None
    while len(chosen) < MOST_FEATURES:
        more = [(*chosen, f) for f in features if f not in chosen]
        trials = screen(fitted, [workshop.free_form(spot.id, m) for m in more])
        if not trials or (best is not None and trials[0].gain < 1.1 * best.gain):
            break
        best = trials[0]
        chosen = next(m for m in more if workshop.free_form(spot.id, m) == best.candidate)
    return [best] if best is not None else []


def _features(fitted: Fitted, module: str) -> list[str]:
    """Readings that vary, their squares and products; what follows from others explains nothing."""
    data = fitted.rows.system.data
    outputs = {name for cell in fitted.rows.cells for name in cell.outputs}
    names = []
    for name, values in variables_of(fitted.rows.system, module).items():
        noise = data.noise.get(name)
        spread = float(np.nanstd(values[data.open]))
        if (
            name not in outputs
            and noise is not None
            and spread > VARYING * float(np.nanmedian(noise))
        ):
            names.append(name)
    names = names[:MOST_READINGS]
    pairs = itertools.combinations_with_replacement(names, 2)
    return [*names, *(f"{a}*{b}" for a, b in pairs)]
