"""Starting values for the refit of a plant that stores, by least squares of simulation errors.

Correlated errors of a model that is far off make a rough likelihood; here errors count as
independent.
"""

import contextlib
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from rulec_runtime.simulation.balances import RanAway

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.evidence import Proposal, amplitudes_of
from rulec.mismatch.evidence.prior import strengths, usual
from rulec.mismatch.evidence.stores.fit import Fitter, independent
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem


def from_afar(
    problem: SimulationProblem,
    setting: Configuration,
    evaluations: int = limits.EVALUATIONS,
    fits: int = limits.FITS_FROM_AFAR,
) -> Configuration:
    """Values of least simulation errors near a setting, as far as the evaluations lead."""
    fitter = Fitter(problem, setting.joined, setting.fixed)
    at = fitter.vector(setting.values)
    measured = problem.record.measured
    noise = {
        n: limits.ERROR_FROM_AFAR * float(np.nanstd(v)) + limits.LEAST_ERROR
        for n, v in measured.items()
    }
    for _ in range(fits):
        judged = independent(problem, {n: Noise(spread, 1.0) for n, spread in noise.items()})
        at = fitter.descend(at, judged, evaluations)
        with contextlib.suppress(RanAway):
            errors, _ = fitter.errors(at, judged)
            left = {n: e[problem.counted[n]] for n, e in errors.items()}
            noise = {
                n: max(float(np.sqrt(np.mean(e**2))), limits.LEAST_ERROR) for n, e in left.items()
            }
    values = fitter.values(at)
    return replace(setting, values={n: values[n] for n in fitter.free})


def nearest(problem: SimulationProblem, every: Sequence[Configuration]) -> Configuration | None:
    """The setting with the smallest residuals, by the sum of their logarithms over readings, of
    those that do not run away."""
    found = list[tuple[float, Configuration]]()
    judged = independent(problem, dict.fromkeys(problem.signals, Noise(1.0, 1.0)))
    for setting in every:
        fitter = Fitter(problem, setting.joined, setting.fixed)
        at = fitter.vector(setting.values)
        values = fitter.values(at)
        there = replace(setting, values={n: values[n] for n in fitter.free})
        with contextlib.suppress(RanAway), np.errstate(all="ignore"):
            errors, _ = fitter.errors(at, judged)
            left = [errors[n][flags] for n, flags in problem.counted.items()]
            size = sum(0.5 * len(own) * float(np.log(np.mean(own**2))) for own in left)
            found.append((size, there))
    return min(found, key=lambda one: one[0])[1] if found else None


def ways_to_join(
    setting: Configuration,
    proposals: Sequence[Proposal],
    references: Callable[[Configuration, Candidate], Mapping[str, float]],
    starts: Callable[[Configuration, Candidate], Iterable[Mapping[str, float]]],
) -> tuple[list[Configuration], ...]:
    """Settings from which the refit of one set may start, by kind: those with predicted strengths,
    and those with typical strengths, with the current and with the stated values of the plant.

    `proposals` are of the same candidates; `references` and `starts` are those of a candidate.
    """
    new = {c.candidate.id: c.candidate for c, _ in proposals[0].starts}.values()
    fixed = {c.id: references(setting, c) for c in new}
    shapes = itertools.product(*(starts(setting, c) for c in new))
    # Each once, in an order that every process has.
    signs = dict.fromkeys(
        tuple((c.amplitude, np.sign(v - (c.amplitude.null or 0.0))) for c, v in one.starts)
        for one in proposals
    )
    sizes = [
        {u.id: size for (u, _), size in zip(ahead, each, strict=True)}
        for ahead in signs
        for each in itertools.product(*(strengths(u, sign) for u, sign in ahead))
    ]
    usually = []
    for each, own in itertools.islice(itertools.product(shapes, sizes), limits.SHAPES):
        there = setting
        for candidate, shape in zip(new, each, strict=True):
            rest = {u.id: usual(u) for u in amplitudes_of(candidate)}
            there = there.joining(candidate, {**shape, **rest}, fixed[candidate.id])
        usually.append(replace(there, values={**there.values, **own}))
    # Beside another explanation the values of the plant are reliable.
    unknowns = {u.id for c in new for u in c.unknowns}
    stated = [
        replace(there, values={n: v for n, v in there.values.items() if n in unknowns})
        for there in (() if setting.joined else usually)
    ]
    return [one.joined_to(setting) for one in proposals], usually, stated
