"""Refit a set for a plant file: no errors of sensors and no errors of form.

The weight of each row follows from the accuracy of its laws, or from a better one where the
residual shows it. Rows that share an error of form count once.

Source: Ribatet, Cooley, Davison 2012 (composite likelihood, scaled to the joint information of its
parts); Tuo and Wu 2015 (the law that is to predict, not the one beside its error of form).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rulec.mismatch import limits
from rulec.mismatch.evidence.samples import HELDOUT
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.operating_state_means import rows_of_states
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.search.refit import Model, refitted
from rulec.mismatch.search.settled.geometry import Geometry


def clear_states(system: System, clear: np.ndarray) -> Rows:
    """Means of operating states in which all but `clear` points, shape (n,), are held out."""
    data = system.data
    part = np.where(clear, data.part, HELDOUT)
    ends = data.time[1:][np.diff(clear)]
    return rows_of_states(replace(system, data=replace(data, part=part)), ends)


def as_written(rows: Rows, starts: Sequence[Configuration]) -> Model:
    """The likeliest refit from several starts."""
    system, smooth, inexact = rows.system, Geometry(rows), 0.0
    squares = np.sum(smooth.forms**2, axis=0)
    # The effective number of independent errors of form.
    ways = float(squares.sum()) ** 2 / max(float(np.sum(squares**2)), 1e-300)
    alike = max(len(smooth.point) / ways, 1.0) if ways else 1.0
    stated = max(float(squares.sum()) / len(smooth.point), 1e-300)
    errors = smooth.shown(smooth.forms)
    for _ in range(limits.ACCURACY_STEPS):
        noise, share = dict(system.data.noise), np.sqrt(alike) * inexact
        for name, error in errors.items():
            noise[name] = np.hypot(noise[name], share * error)
        noisier = replace(system, data=replace(system.data, noise=noise))
        geometry = Geometry(rows_of(noisier, Configuration()), exact=True)
        found = [refitted(geometry, start, without_error=system.shared) for start in starts]
        best = max(found, key=lambda model: model.evidence)
        starts = [best.setting]
        off = rows.errors(system.flows(best.setting))[0][smooth.seen]
        inexact = float(np.sqrt(np.clip((np.mean(off**2) - 1.0) / stated, 0.0, 1.0)))
    return best
