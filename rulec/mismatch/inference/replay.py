"""Replays of a recording by the plant's own model.

Only its conditions count: inputs, noise, and possible errors of sensors, parameters and laws. Its
readings do not.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.mismatch.search.evidence import Evidence, Random
from rulec.mismatch.search.refit import Model


def without_explanations(geometry: Evidence, model: Model) -> Model:
    """A model with its values and its sizes of errors, but without explanations.

    Replays use the values believed with the explanations: without those, the same model would need
    larger errors.
    """
    setting = model.setting
    for candidate in setting.joined:
        setting = setting.leaving(candidate.id)
    prior = geometry.prior(setting)
    at = np.clip(prior.of(setting.values), prior.lowest, prior.highest)
    now = geometry.evaluated(setting, prior, at)
    random = Random(geometry.forms, geometry.law, geometry.moving, geometry.held, ())
    sizes = replace(model.sizes, terms=())
    raw = np.concatenate([now.jacobian, random.columns * random.ratio(sizes)], axis=1)
    precision = np.eye(raw.shape[1])
    precision[: len(at), : len(at)] = prior.near(at).precision
    return replace(
        model,
        point=now,
        prior=prior,
        mean=at,
        at=at,
        terms=(),
        sizes=sizes,
        table=geometry.whitened(raw, model.noise),
        left=np.zeros(len(raw)),
        raw=raw,
        off=np.zeros(len(raw)),
        precision=precision,
        weights=geometry.expected_weights(model.noise),
    )


@dataclass(frozen=True)
class Replayer:
    """Draws replays of the whitened rows by a model without explanations."""

    geometry: Evidence
    model: Model

    def drawn(self, count: int, shift: Array, seed: int = 0) -> Array:
        """Residuals at the means of the values, shape (rows, count).

        `shift`, shape (rows, 1) or (rows, count), is the effect of a concealed explanation on them.
        """
        model = self.model
        rng = np.random.default_rng(seed)
        # Parameters of a plant have very different units: their precision is scaled first.
        unit = np.sqrt(np.diag(model.precision))
        lower = np.linalg.cholesky(model.precision / np.outer(unit, unit))
        normal = rng.standard_normal((len(unit), count))
        values = np.linalg.solve(lower.T, normal) / unit[:, None]
        noise = self.geometry.drawn(model.noise, count, rng)
        return np.asarray(noise - model.table @ values - shift)
