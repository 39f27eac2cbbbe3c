"""Step 4: rivals that must lose, and explanations that would do instead."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.fit import Fitted, fit, student_weights
from rulec.mismatch.evidence.steady.locate import spot_column
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.result import Rival
from rulec.mismatch.search.compete import (
    CrossValidated,
    amplifies_noise,
    contest,
    placebo_gains,
    shuffled_gains,
)
from rulec.mismatch.search.weigh import needed, net_gain


def released(now: CrossValidated, ranked: Sequence[CrossValidated]) -> CrossValidated | None:
    """The model with the parameters of the suspected module free; None if that gains nothing."""
    if not ranked or ranked[0].trial is None:
        return None
    modules = ranked[0].trial.candidate.modules
    setting, fitted = now.fitted.setting, now.fitted
    ways = [
        fit(fitted.rows, way, fitted.used, variance_inflation=fitted.variance_inflation)
        for way in setting.wider(modules, fitted.rows.system.contradicted)
    ]
    eased = [contest(way, now.trial) for way in ways if way.keeps_trust]
    easing = max(eased, key=lambda e: net_gain(e, now), default=None)
    return easing if easing is not None and net_gain(easing, now) > needed(now, 1) else None


def beats(contestant: CrossValidated, easing: CrossValidated, now: CrossValidated) -> bool:
    """Is an explanation worth more than letting the calibration go?

    A fault or a sensor error stands beside a calibration that holds, and need only be as good.
    """
    assert contestant.trial is not None
    lead = net_gain(contestant, now) - net_gain(easing, now)
    physics = contestant.trial.candidate.sort in ("physics", "ageing")
    return lead > (needed(now, 1) if physics else -limits.NEEDED)


def defeated(
    contestant: CrossValidated, now: CrossValidated, easing: CrossValidated | None, tried: int
) -> tuple[Rival, ...] | None:
    """The rivals with their gains; None where one of them does as well."""
    net = net_gain(contestant, now)
    if net < needed(now, tried) or contestant.sureness_over(now) < limits.SURE:
        return None
    trial = contestant.trial
    assert trial is not None
    if at_an_end(contestant, trial.candidate) or amplifies_noise(now.fitted, contestant.fitted):
        return None
    if not _is_there(contestant.fitted, trial):
        return None
    shuffled = shuffled_gains(
        _let_go(now, contestant), contestant.fitted, limits.SHUFFLES, limits.SEED
    )
    placebo = _placebo(now.fitted, trial)
    # A term without a driver of its own has no course that could be shuffled.
    imitated = bool(trial.candidate.drivers) and shuffled.is_imitated
    if trial.course is None and (imitated or net <= placebo):
        return None
    rivals = [Rival("the plain model, recalibrated", _eased_gain(easing, now))]
    if trial.course is None:
        rivals.append(Rival("as many parameters without physics", placebo))
        if trial.candidate.drivers and not shuffled.is_steady:
            worst = float(shuffled.gains.max())
            rivals.append(Rival("its own course, shuffled by blocks", worst))
    # A rival that is told must have lost, whatever excused it.
    return tuple(rivals) if all(rival.gain < net for rival in rivals) else None


def _eased_gain(easing: CrossValidated | None, now: CrossValidated) -> float:
    return 0.0 if easing is None else net_gain(easing, now)


def _is_there(fitted: Fitted, trial: InitialCandidate) -> bool:
    """Does a strength of it differ from its null? Else it gains by what the model without it lost.

    What comes and goes is not asked: it is a step in what is left, which was seen. Nor is what has
    a shape as well: a strength may be open because the shape is.
    """
    free = [u for u in trial.candidate.unknowns if not u.fixed]
    if len(free) > 1 or any(u.null is None or u.id not in fitted.setting.values for u in free):
        return True
    return all(
        abs(fitted.setting.values[u.id] - (u.null or 0.0)) > limits.SOMETHING * fitted.u(u.id)
        for u in free
    )


def _let_go(now: CrossValidated, contestant: CrossValidated) -> Fitted:
    """The model without an explanation, its calibration let go where the explanation lets it go.

    Under a calibration that holds, a term shows little that base values must make room for.
    """
    fitted, theirs = now.fitted, contestant.fitted.setting
    setting = fitted.setting.letting_go(theirs.released, theirs.trusted)
    if setting == fitted.setting:
        return fitted
    return fit(fitted.rows, setting, fitted.used, variance_inflation=fitted.variance_inflation)


def at_an_end(contestant: CrossValidated, *candidates: Candidate) -> bool:
    """Did one of some laws in a model run to an end of its range? It fits for another reason."""
    values = contestant.fitted.setting.values
    for unknown in (u for c in candidates for u in c.unknowns):
        value = values.get(unknown.id)
        if value is None or value == unknown.null:
            continue
        for end in (unknown.lowest, unknown.highest):
            # A range that begins at the null may be so wide that what is small lies near it.
            if end == unknown.null:
                continue
            if np.isfinite(end) and abs(value - end) <= 1e-6 * (unknown.highest - unknown.lowest):
                return True
    return False


def _placebo(fitted: Fitted, trial: InitialCandidate) -> float:
    """Best gain of smooth functions of time at the place of a trial."""
    columns = _columns(fitted, trial)
    if not columns or trial.course is not None:
        return 0.0
    return float(placebo_gains(fitted, trial, columns, limits.SEED).max())


def _columns(fitted: Fitted, trial: InitialCandidate) -> list[Array]:
    """Slopes of the residuals by an error at the place of a trial."""
    candidate = trial.candidate
    spots = fitted.rows.system.builder.spots
    here = [s for s in spots if (s.module, s.place) == (candidate.module, candidate.place)]
    here = here or [s for s in spots if set(s.observers) & set(candidate.observers)][:1]
    return [c for c in (spot_column(fitted, s) for s in here) if c is not None]


def instead_of(
    winner: CrossValidated, ranked: Sequence[CrossValidated], now: CrossValidated
) -> list[CrossValidated]:
    """Explanations of the same thing: they change the residuals alike."""
    rows = now.fitted.rows
    weight = student_weights(rows, now.fitted.residual, now.fitted.scale)
    weight = weight * now.fitted.used[rows.point]

    def change(contestant: CrossValidated) -> Array:
        return now.fitted.residual - contestant.fitted.residual

    own = change(winner)
    found = []
    for other in ranked:
        course = change(other)
        size = float(np.sqrt(np.sum(weight * own**2) * np.sum(weight * course**2)))
        if other is not winner and float(np.sum(weight * own * course)) > limits.SAME_CHANGE * size:
            found.append(other)
    return found
