"""Starting values for the refit of a plant that stores, by least squares of simulation errors.

Correlated errors of a model that is far off make a rough likelihood; here errors count as
independent.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.simulation.balances import RanAway

from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.stores.fit import Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise, no_drift
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem


def from_afar(
    bench: SimulationProblem,
    setting: Configuration,
    evaluations: int = limits.EVALUATIONS,
    fits: int = limits.FITS_FROM_AFAR,
) -> Configuration:
    """Values of least simulation errors near a setting, as far as the evaluations lead."""
    fitter = Fitter(bench, setting.joined, setting.fixed)
    at = fitter.vector(setting.values)
    measured = bench.record.measured
    noise = {n: limits.ERROR_FROM_AFAR * float(np.nanstd(v)) + 1e-12 for n, v in measured.items()}
    for _ in range(fits):
        judged = _judged(bench, noise)
        at = fitter.descend(at, judged, judged.basis(), evaluations)
        with contextlib.suppress(RanAway):
            errors, _ = fitter.errors(at, judged)
            noise = {n: float(np.sqrt(np.mean(e[bench.known[n]] ** 2))) for n, e in errors.items()}
    values = fitter.values(at)
    return replace(setting, values={n: values[n] for n in fitter.free})


def nearest(bench: SimulationProblem, every: Sequence[Configuration]) -> Configuration | None:
    """The setting with the smallest residuals, by the sum of their logarithms over readings, of
    those that do not run away."""
    found = list[tuple[float, Configuration]]()
    for setting in every:
        fitter = Fitter(bench, setting.joined, setting.fixed)
        at = fitter.vector(setting.values)
        values = fitter.values(at)
        there = replace(setting, values={n: values[n] for n in fitter.free})
        with contextlib.suppress(RanAway), np.errstate(all="ignore"):
            errors, _ = fitter.errors(at, _judged(bench, dict.fromkeys(bench.signals, 1.0)))
            left = [errors[n][known] for n, known in bench.known.items()]
            size = sum(0.5 * len(own) * float(np.log(np.mean(own**2))) for own in left)
            found.append((size, there))
    return min(found, key=lambda one: one[0])[1] if found else None


def _judged(bench: SimulationProblem, noise: dict[str, float]) -> Judged:
    """Weights of independent errors of the given standard deviation."""
    new = {n: Noise(spread, 1.0) for n, spread in noise.items()}
    return Judged(bench.known, new, no_drift(bench), np.zeros(0))
