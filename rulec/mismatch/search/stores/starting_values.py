"""Where a refit of a plant that stores may begin: values to which plain simulation errors lead.

What lasts in a model that is far off makes a rough landscape; here each error counts as new.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.simulation.balances import RanAway

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.stores.drift import no_drift
from rulec.mismatch.evidence.stores.fit import Fitter, Judged
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search import limits


def from_afar(
    bench: SimulationProblem,
    setting: Configuration,
    evaluations: int = limits.EVALUATIONS,
    fits: int = limits.FITS_FROM_AFAR,
) -> Configuration:
    """The least squares of a simulation near a setting, as far as so many evaluations lead."""
    fitter = Fitter(bench, setting.joined, setting.fixed)
    at = fitter.vector(setting.values)
    measured = bench.record.measured
    noise = {n: limits.FAR_OFF * float(np.nanstd(v)) + 1e-12 for n, v in measured.items()}
    for _ in range(fits):
        judged = _judged(bench, noise)
        at = fitter.descend(at, judged, judged.basis(), evaluations)
        with contextlib.suppress(RanAway):
            errors, _ = fitter.errors(at, judged)
            noise = {n: float(np.sqrt(np.mean(e[bench.known[n]] ** 2))) for n, e in errors.items()}
    values = fitter.values(at)
    return replace(setting, values={n: values[n] for n in fitter.free})


def nearest(bench: SimulationProblem, every: Sequence[Configuration]) -> Configuration | None:
    """The setting that leaves least, in logarithms of its size in each reading, of those that do
    not run away."""
    found = list[tuple[float, Configuration]]()
    for setting in every:
        fitter = Fitter(bench, setting.joined, setting.fixed)
        at = fitter.vector(setting.values)
        values = fitter.values(at)
        there = replace(setting, values={n: values[n] for n in fitter.free})
        with contextlib.suppress(RanAway), np.errstate(all="ignore"):
            errors, _ = fitter.errors(at, _judged(bench, dict.fromkeys(bench.signals, 1.0)))
            seen = [errors[n][known] for n, known in bench.known.items()]
            found.append((sum(_left(own) for own in seen), there))
    return min(found, key=lambda one: one[0])[1] if found else None


def _left(errors: np.ndarray) -> float:
    return 0.5 * len(errors) * float(np.log(np.mean(errors**2)))


def _judged(bench: SimulationProblem, noise: dict[str, float]) -> Judged:
    """All errors new, each as large as the noise of its reading says."""
    new = {n: Noise(spread, 1.0) for n, spread in noise.items()}
    return Judged(bench.known, new, no_drift(bench), np.zeros(0))
