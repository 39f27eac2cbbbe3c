"""Recorded temperatures as evidence for or against a change of the liquid.

A property such as the viscosity follows the temperature by a known share per kelvin. A temperature
that moved as much as the change needs supports it, a constant one contradicts it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import LiquidSpec
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.causes import Cause
from rulec_runtime.diagnosis.steady.combine import ONSET, Fit, Fits
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints


def is_ordinary(changes: Sequence[LiquidSpec], fault: str, degree: float) -> bool:
    """Whether weather explains this change of the liquid."""
    return any(
        change.fault.id == fault
        and abs(degree) < -math.expm1(-abs(change.per_kelvin) * limits.ORDINARY_KELVIN)
        for change in changes
    )


@dataclass(frozen=True)
class Warming:
    """Rise of thermometers, by name, between the baseline of a run and the run, K: their median."""

    thermometers: tuple[str, ...]
    rise: float

    def words(self) -> str:
        """For a sentence: ``A.T fell by 8.2 K``."""
        many = len(self.thermometers) > 1
        name = f"{len(self.thermometers)} temperatures" if many else self.thermometers[0]
        if abs(self.rise) < limits.SAME_TEMPERATURE:
            return f"{name} stayed within {limits.SAME_TEMPERATURE:g} K"
        way = "rose" if self.rise > 0.0 else "fell"
        return f"{name} {way} by {abs(self.rise):.2g} K"


def by_temperature(evaluated: EvaluatedPoints, members: Sequence[int], fits: Fits) -> Fits:
    """Fits of a run, with the evidence of temperatures for changes of the liquid."""
    changes = _changes(evaluated)

    def weighed(fit: Fit) -> Fit:
        faults = zip(fit.faults, fit.degrees, strict=True)
        found = [(changes[i], x) for i, x in faults if i in changes]
        if not found or fit.when != ONSET:
            return fit
        evidence = sum(
            _evidence(change, x, _warming(evaluated, change, members)) for change, x in found
        )
        return replace(fit, evidence=fit.evidence + evidence)

    return replace(fits, tried=[weighed(fit) for fit in fits.tried]) if changes else fits


def with_temperature(
    evaluated: EvaluatedPoints, members: Sequence[int], cause: Cause
) -> tuple[Cause, str]:
    """A cause, and an addition to its text. For a change of the liquid, its bounds include the
    tolerance of its laws, and the text says what temperatures show."""
    change = _changes(evaluated).get(cause.fault)
    if change is None:
        return cause, ""
    half = common.COVERAGE * change.fault.tolerance * cause.degree
    lower = cause.degree - math.hypot(half, cause.degree - cause.lower)
    upper = cause.degree + math.hypot(half, cause.upper - cause.degree)
    wide = replace(cause, lower=lower, upper=upper)
    warming = _warming(evaluated, change, members) if cause.when == ONSET else None
    if warming is None:
        return wide, ""
    evidence = _evidence(change, cause.degree, warming)
    meaning = "which speaks for it" if evidence > 0.0 else "which speaks against it"
    return wide, f"; meanwhile {warming.words()}{', ' + meaning if evidence else ''}"


def _changes(evaluated: EvaluatedPoints) -> dict[int, LiquidSpec]:
    """Changes of the liquid by their places among the faults of a part."""
    ruleset = evaluated.part.ruleset
    changes = {change.fault.id: change for change in ruleset.liquid}
    return {i: changes[f.id] for i, f in enumerate(ruleset.faults) if f.id in changes}


def _warming(
    evaluated: EvaluatedPoints, change: LiquidSpec, members: Sequence[int]
) -> Warming | None:
    """Change of temperatures; None if the property depends on none, or none is known."""
    learned = evaluated.baselines.learned_at(members[0])
    if not (change.per_kelvin and len(learned)):
        return None
    values, rises = evaluated.points.values, {}
    for name in change.thermometers:
        if name in values:
            before, now = values[name][learned], values[name][np.asarray(members)]
            if np.isfinite(before).any() and np.isfinite(now).any():
                rises[name] = float(np.nanmean(now) - np.nanmean(before))
    if not rises:
        return None
    return Warming(tuple(rises), float(np.median([*rises.values()])))


def _evidence(change: LiquidSpec, degree: float, warming: Warming | None) -> float:
    """Log-likelihood of a change of the liquid by the temperatures; 0 if they do not decide."""
    if warming is None or degree <= 0.0:
        return 0.0
    needed = math.log1p(change.sign * min(degree, common.NEARLY_ALL if change.sign < 0 else degree))
    share = change.per_kelvin * warming.rise / needed
    bound = change.factor**common.COVERAGE
    if share < 1.0 / bound:
        return -limits.BY_TEMPERATURE
    return limits.BY_TEMPERATURE if share <= bound else 0.0
