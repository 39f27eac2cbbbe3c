"""Which of some refitted models wins a round, and what is recorded of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rulec.effects.candidate import TIME
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.result import Rival
from rulec.mismatch.search.accepted import Won
from rulec.mismatch.search.compete import CrossValidated, Refit, contest, cost_of
from rulec.mismatch.search.rivals import at_an_end, beats, defeated, instead_of, released
from rulec.mismatch.search.weigh import gain_in_sample, net_gain, odds_of


@dataclass(frozen=True)
class Step:
    """A round: the model that won it, if any; no records where a recalibration did.

    `tried` counts all explanations tried so far, `finalists` are the best that were tried alone.
    """

    winner: CrossValidated | None
    records: tuple[Won, ...]
    tried: int
    finalists: tuple[InitialCandidate, ...] = ()


def gain_of(step: Step | None, now: CrossValidated) -> float:
    """Net gain of the winner of a step; none without one."""
    return net_gain(step.winner, now) if step is not None and step.winner is not None else 0.0


def contested(refitted: Sequence[Refit], now: CrossValidated) -> list[CrossValidated]:
    """Those that fit best in the sample, judged on blocks they were not fitted to, best first."""
    by_fit = sorted(refitted, key=lambda f: cost_of(f[0]))
    chosen = [contest(fitted, trial) for fitted, trial in by_fit[: limits.CONTESTED]]
    return sorted(chosen, key=lambda c: -net_gain(c, now))


def best_of(refitted: Sequence[Refit], now: CrossValidated) -> CrossValidated | None:
    return max((contest(*r) for r in refitted), key=lambda c: gain_in_sample(c, now), default=None)


def first_to_win(
    now: CrossValidated, ranked: Sequence[CrossValidated], hidden: CrossValidated | None, tried: int
) -> Step | None:
    """The first that beats all rivals; or the calibration let go, where that does as well."""
    easing = released(now, ranked)
    for contestant in ranked:
        if easing is not None and not beats(contestant, easing, now):
            return Step(easing, (), tried)
        if hidden is not None and not _as_good(contestant, hidden, now):
            continue
        rivals = defeated(contestant, now, easing, tried)
        if rivals is None:
            continue
        # Of those that explain the same, the most probable: the first may lead by next to nothing.
        for other in instead_of(contestant, ranked, now):
            lost = defeated(other, now, easing, tried)
            if lost is not None and odds_of(other, contestant) > limits.EVEN:
                contestant, rivals = other, lost
        return Step(contestant, recorded(contestant, now, ranked, rivals), tried)
    return None


def _as_good(contestant: CrossValidated, hidden: CrossValidated, now: CrossValidated) -> bool:
    """Does an explanation do what a course that is free in time would do?

    One whose driver is recorded may leave a part to others. What follows only the clock, or comes
    and goes, is itself no more than a course, and must be the better one.
    """
    trial = contestant.trial
    assert trial is not None
    comes_and_goes = any(t.course is not None for t in (trial, *trial.along))
    if not comes_and_goes and TIME not in trial.candidate.drivers.values():
        return True
    return gain_in_sample(contestant, now) > gain_in_sample(hidden, now)


def recorded(
    winner: CrossValidated,
    now: CrossValidated,
    ranked: Sequence[CrossValidated],
    rivals: tuple[Rival, ...],
) -> tuple[Won, ...]:
    """What was accepted; two records where two explanations were needed at once."""
    assert winner.trial is not None
    alike = instead_of(winner, ranked, now)
    others = [c for c in alike if net_gain(c, now) > 0 and not runs_out(c)]
    trials = (winner.trial, *winner.trial.along)
    ours = {t.candidate.id for t in trials}
    records = []
    for trial in trials:
        kept: dict[str, tuple[InitialCandidate, float]] = {}
        for other in others:
            instead_ = _in_place_of(trial, ours, other)
            if instead_ is not None and instead_.candidate.id not in kept:
                kept[instead_.candidate.id] = (instead_, min(odds_of(other, winner), 1.0))
        gain = net_gain(winner, now) / len(trials)
        # What lost against both together is told as its part beside the part of each.
        lost = tuple(replace(rival, gain=rival.gain / len(trials)) for rival in rivals)
        rest = tuple(kept.values())
        records.append(Won(trial, gain, lost, tuple(t for t, _ in rest), tuple(o for _, o in rest)))
    return tuple(records)


def runs_out(contestant: CrossValidated) -> bool:
    """Is a law of it at an end of its range? It lost, whatever it gains."""
    trial = contestant.trial
    return trial is not None and at_an_end(
        contestant, *(t.candidate for t in (trial, *trial.along))
    )


def _in_place_of(
    trial: InitialCandidate, ours: set[str], other: CrossValidated
) -> InitialCandidate | None:
    """What another model has instead of an explanation; None if it has the same.

    `ours` are the ids of all that was found together.
    """
    assert other.trial is not None
    theirs = (other.trial, *other.trial.along)
    if trial.candidate.id in {t.candidate.id for t in theirs}:
        return None
    return next((t for t in theirs if t.candidate.id not in ours), other.trial)
