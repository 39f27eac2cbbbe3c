"""Steps 1 and 3: add one explanation after the other, as long as each beats its rivals."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.configuration import HIDDEN, Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import InitialCandidate, screen, with_open_references
from rulec.mismatch.search.accepted import Won
from rulec.mismatch.search.compete import CrossValidated, contest, cost_of, refit
from rulec.mismatch.search.exchange import exchanged, weighed
from rulec.mismatch.search.latent_input import hidden_trials
from rulec.mismatch.search.pairs import torn_pairs
from rulec.mismatch.search.revise import instead, needless, recut, retempered
from rulec.mismatch.search.search_round import best_step
from rulec.mismatch.search.weigh import gain_in_sample, net_gain, odds_of
from rulec.mismatch.search.winner import best_of, contested, first_to_win, recorded

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Search:
    """What was found: the plain model refitted, the repaired one, and how it came about."""

    plain: CrossValidated
    best: CrossValidated
    accepted: tuple[Won, ...]
    tried: int


def search(rows: Rows, progress: Progress) -> Search:
    """Find what explains a recording, one explanation at a time."""
    data = rows.system.data
    progress("refitting the plain model")
    plain = contest(retempered(fit(rows, Configuration(), data.open)), None)
    named = _or_begun_with_two(plain, _one_by_one(plain, plain, (), 0, progress), progress)
    if not named.accepted or any(r.trial.candidate.sort == HIDDEN for r in named.accepted):
        return named
    # Several names may together imitate one driver that nobody recorded.
    hidden = best_of([refit(plain.fitted, t) for t in hidden_trials(plain.fitted)], plain)
    if hidden is None:
        return named
    ahead = gain_in_sample(hidden, plain) - gain_in_sample(named.best, plain)
    one = len(named.accepted) == 1 and not _is_free(named.accepted[0])
    if ahead < (limits.NEEDED if one else 0.0):
        return named
    progress("a driver that nobody recorded explains more than all names")
    first = recorded(hidden, plain, [], ())
    return _one_by_one(plain, hidden, first, named.tried, progress)


def _or_begun_with_two(plain: CrossValidated, found: Search, progress: Progress) -> Search:
    """What is found if the first two are chosen together, where one by one it took many.

    The best single explanation of two that are left out may be neither of them. All that follows
    then mends what it does wrong, and each is needed beside the others.
    """
    if sum(r.trial.candidate.sort != HIDDEN for r in found.accepted) < limits.MANY:
        return found
    progress("looking for two explanations that say the same as all of these")
    candidates = plain.fitted.rows.system.candidates
    singles = [refit(plain.fitted, t) for t in screen(plain.fitted, candidates)[: limits.FINALISTS]]
    pairs = torn_pairs(plain.fitted, contested(singles, plain), candidates, limits.CONTESTED)
    step = first_to_win(plain, contested(pairs, plain), None, found.tried)
    if step is None or step.winner is None or not step.records:
        return found
    winner = step.winner
    records = tuple(_weighed(winner, r, _beside(winner, r)) for r in step.records)
    other = _one_by_one(plain, winner, records, found.tried, progress)
    return max((found, other), key=lambda way: _worth(way, plain))


def _beside(now: CrossValidated, record: Won) -> list[InitialCandidate]:
    """What may stand in the place of an explanation, beside the others of a model."""
    name = record.trial.candidate.id
    candidates = now.fitted.rows.system.candidates
    joined = {c.id for c in now.fitted.setting.joined}
    free = [c for c in candidates if c.id not in joined]
    return screen(_without(now, name).fitted, free)[: limits.FINALISTS]


def _worth(found: Search, plain: CrossValidated) -> float:
    """What was gained, less what must be gained for each explanation."""
    return net_gain(found.best, plain) - limits.NEEDED * len(found.accepted)


def _one_by_one(
    plain: CrossValidated,
    now: CrossValidated,
    begun: tuple[Won, ...],
    tried: int,
    progress: Progress,
) -> Search:
    """Add explanations to a model, which may have some, until none is worth it."""
    accepted = list(begun)
    names_once_more = True
    candidates = plain.fitted.rows.system.candidates
    while len(accepted) < limits.MOST_TERMS and not any(_is_free(r) for r in accepted):
        progress(f"looking for explanation {len(accepted) + 1} among {len(candidates)}")
        named = sum(r.gain for r in accepted if r.trial.candidate.sort != HIDDEN)
        step = best_step(now, candidates, tried, named)
        tried = step.tried
        if step.winner is None:
            break
        now = step.winner
        if step.records:
            earlier = [r.trial.candidate.id for r in accepted]
            now, gone = needless(recut(now), earlier)
            accepted = [r for r in accepted if r.trial.candidate.id not in gone]
            if gone and names_once_more and _is_free(step.records[0]):
                # It was ahead of names beside something that it made needless.
                names_once_more = False
                now = _without(now, step.records[0].trial.candidate.id)
                continue
            now, records = _asked_again(now, step.records)
            paired = len(records) > 1
            if gone or paired:  # weighed beside what is not there any more, or not at all
                finalists = step.finalists if paired else ()
                records = tuple(_weighed(now, r, finalists) for r in records)
            accepted += records
        now = _eased(contest(retempered(now.fitted), now.trial))
    now, found = exchanged(now, accepted)
    return Search(plain, now, found, tried)


def _is_free(record: Won) -> bool:
    return record.trial.candidate.sort == "free"


def _without(now: CrossValidated, name: str) -> CrossValidated:
    """The model with one explanation left out, neighbours counted as what they are worth then."""
    fitted = now.fitted
    bare = fit(
        fitted.rows,
        fitted.setting.leaving(name),
        fitted.used,
        variance_inflation=fitted.variance_inflation,
    )
    return contest(retempered(bare), None)


def _weighed(now: CrossValidated, record: Won, finalists: Sequence[InitialCandidate]) -> Won:
    """The odds of others that last, in the model as it is."""
    if record.trial.course is not None or record.trial.candidate.sort in ("free", HIDDEN):
        return record
    lasting = [t for t in record.others if t.course is None][: limits.FINALISTS]
    known = {t.candidate.id for t in lasting}
    return weighed(now, record, [*lasting, *(t for t in finalists if t.candidate.id not in known)])


def _eased(now: CrossValidated) -> CrossValidated:
    """The calibration under laws that left something out let go, if that is worth it by now.

    With less left unexplained, a departure from stated values shows that was small before. They
    may hold for other conditions than the usual ones of this recording, or not hold at all.
    """
    for candidate in now.fitted.setting.joined:
        setting, system = now.fitted.setting, now.fitted.rows.system
        if candidate.sort not in ("physics", "ageing") or setting.released & {*candidate.modules}:
            continue
        there = with_open_references(
            system,
            InitialCandidate(
                candidate=candidate,
                values=_own(setting.values, candidate),
                fixed=setting.fixed,
                gain=0.0,
            ),
        )
        if there is not None:
            bare = setting.leaving(candidate.id)
            now = _widened(now, bare.joining(there.candidate, there.values, there.fixed))
    setting = now.fitted.setting
    physics = [c for c in setting.joined if c.sort in ("physics", "ageing")]
    modules = frozenset[str]().union(*(c.modules for c in physics))
    if modules <= setting.released:
        return now
    return _widened(now, setting.letting_go(modules))


def _own(values: Mapping[str, float], candidate: Candidate) -> dict[str, float]:
    return {u.id: values[u.id] for u in candidate.unknowns if u.id in values}


def _widened(now: CrossValidated, wider: Configuration) -> CrossValidated:
    """The model with more values free, if it is simpler so, neighbours counted alike in both."""
    fitted = now.fitted
    freed = retempered(
        fit(fitted.rows, wider, fitted.used, variance_inflation=fitted.variance_inflation)
    )
    held = fit(
        fitted.rows, fitted.setting, fitted.used, variance_inflation=freed.variance_inflation
    )
    return contest(freed, now.trial) if cost_of(freed) < cost_of(held) else now


def _asked_again(
    now: CrossValidated, records: tuple[Won, ...]
) -> tuple[CrossValidated, tuple[Won, ...]]:
    """The winner, or one of those that explain the same, where faults come and go beside it."""
    if len(records) != 1 or not now.fitted.setting.courses or records[0].trial.course is not None:
        return now, records
    record = records[0]
    close = [t for t, o in zip(record.others, record.odds, strict=True) if o > limits.CLOSE]
    lasting = [t for t in close if t.course is None]
    better, name = instead(now, record.trial.candidate.id, lasting)
    if better is now:
        return now, records
    trial = next(t for t in lasting if t.candidate.id == name)
    # The one that had won is now the other, at the odds by which it lost.
    others = (record.trial, *(t for t in record.others if t is not trial))
    kept = [o for t, o in zip(record.others, record.odds, strict=True) if t is not trial]
    swapped = replace(
        record, trial=trial, others=others, odds=(min(odds_of(now, better), 1.0), *kept)
    )
    return better, (swapped,)
