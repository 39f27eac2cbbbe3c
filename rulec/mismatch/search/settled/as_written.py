"""A set refitted as a plant file holds it: sensors as they are, and no errors of form.

Each row counts as its laws are exact by their accuracy, or better where they turn out to be, and
rows that share an error of form count once.

Source: Ribatet, Cooley, Davison 2012 (composite likelihood, raised to what its parts say together);
Tuo and Wu 2015 (the law that is to predict, not the one beside its error of form).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rulec.mismatch import limits
from rulec.mismatch.evidence.samples import HELDOUT
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.states import rows_of_states
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.search.refit import Model, refitted
from rulec.mismatch.search.settled.geometry import Geometry


def clear_states(system: System, clear: np.ndarray) -> Rows:
    """Means of operating states of which only points that are `clear`, shape (n,), are seen."""
    data = system.data
    part = np.where(clear, data.part, HELDOUT)
    ends = data.time[1:][np.diff(clear)]
    return rows_of_states(replace(system, data=replace(data, part=part)), ends)


def as_written(rows: Rows, starts: Sequence[Configuration]) -> Model:
    """The likeliest refit from several starts."""
    smooth, inexact = Geometry(rows), 0.0
    squares = np.sum(smooth.forms**2, axis=0)
    # As many independent errors of form there are as their sizes are alike.
    ways = float(squares.sum()) ** 2 / max(float(np.sum(squares**2)), 1e-300)
    alike = max(len(smooth.point) / ways, 1.0) if ways else 1.0
    stated = max(float(squares.sum()) / len(smooth.point), 1e-300)
    errors = smooth.shown(smooth.forms)
    for _ in range(limits.ACCURACY_STEPS):
        geometry = Geometry(_noisier(rows, errors, np.sqrt(alike) * inexact), exact=True)
        none = rows.system.shared
        found = [refitted(geometry, start, without_error=none) for start in starts]
        best = max(found, key=lambda model: model.evidence)
        starts = [best.setting]
        off = rows.errors(rows.system.flows(best.setting))[0][smooth.seen]
        inexact = float(np.sqrt(np.clip((np.mean(off**2) - 1.0) / stated, 0.0, 1.0)))
    return best


def _noisier(rows: Rows, errors: Mapping[str, float], share: float) -> Rows:
    """Rows whose outputs are off by a share of some `errors`, SI, besides their noise."""
    data, noise = rows.system.data, dict(rows.system.data.noise)
    for name, error in errors.items():
        noise[name] = np.hypot(noise[name], share * error)
    return rows_of(replace(rows.system, data=replace(data, noise=noise)), Configuration())
