"""The gain beside a model, to first order: of candidates, of pairs of them, and of terms."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from rulec_runtime.contract.plan import Array

from rulec.effects.candidate import Candidate
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.evidence import Column, Evidence, Names, Proposal
from rulec.mismatch.evidence.term import Term
from rulec.mismatch.search import limits
from rulec.mismatch.search.refit import Model

Alike = Mapping[str, frozenset[str]]
"""Per fault those with the same or the opposite signature: only one of them may be joined."""


def alike_faults(found: Sequence[Column]) -> Alike:
    """Faults whose columns are parallel or antiparallel."""
    lasting = (c for c in found if c.course is None or not c.course.periods[0].since)
    faults = {c.candidate.id: c.rows for c in lasting if c.candidate.sort == "fault"}
    alike: dict[str, frozenset[str]] = {}
    for name, rows in faults.items():
        cosines = {
            other: abs(float(rows @ own)) / float(np.linalg.norm(rows) * np.linalg.norm(own))
            for other, own in faults.items()
        }
        alike[name] = frozenset(o for o, cosine in cosines.items() if cosine > common.SAME_PATTERN)
    return alike


def scan(
    evidence: Evidence, model: Model, every: Sequence[Column], alike: Alike, most: int
) -> list[Proposal]:
    """The best single columns and pairs beside a model, by several views of the recording.

    One has the weights of the model. One weights all rows alike, which shows large and rare errors.
    One has the prior of the data sheets and ignores all calibrations, as each may have been made
    with the effect present. Beside nothing, one has smaller errors of laws and of sensors that
    move, and calibrations as firm as stated: where a large effect is missing these replace it, so
    that no explanation would gain anything beside them.
    """
    alone, n = not model.setting.joined and not model.terms, len(model.at)
    noises = evidence.levels(model.noise, model.rest, alone=alone)
    levels = [model.under(evidence, noise) for noise in noises]
    sheet, precision, mean = model.prior.belief.by_sheet, model.precision.copy(), model.mean.copy()
    k = len(sheet.mean)
    precision[:k, :k], mean[:k] = sheet.precision, sheet.mean
    left = model.left + model.table[:, :n] @ (mean - model.mean)
    views = [(model, most, limits.PAIRED_COLUMNS)]
    others = (*levels, replace(model, precision=precision, left=left))
    views += [(other, most // 2, limits.PAIRED_COLUMNS) for other in others]
    if alone:
        # Far from the model slopes hardly predict the gain of a large effect: more are tried.
        count = limits.FIRST_SETS if len(levels) == 1 else most
        table, precision = model.table.copy(), model.precision.copy()
        table[:, n : n + evidence.forms.shape[1] + evidence.moving.shape[1]] *= limits.STIFF
        precision[:n, :n] = model.prior.near(model.mean).precision
        views.append((levels[0], count, 0))
        views.append((replace(model, table=table, precision=precision), count, 0))
    found = [one for view in views for one in _scanned(evidence, every, *view)]
    ids = [[column.candidate.id for column, _ in one.starts] for one in found]
    allowed = (
        one
        for one, own in zip(found, ids, strict=True)
        if not any(b in alike.get(a, ()) for a, b in combinations(own, 2))
    )
    return sorted(allowed, key=lambda f: -f.gain)


def _scanned(
    evidence: Evidence, every: Sequence[Column], model: Model, most: int, paired: int
) -> list[Proposal]:
    """The best columns beside a model, and the best pairs of the `paired` best ones: of two
    candidates, or two amplitudes of one, whose prior counts once."""
    if not every:
        return []
    usual = [evidence.size(c.candidate, c.amplitude) for c in every]
    scale = np.array([u.scale for u in usual])
    rows = evidence.whitened(np.stack([c.rows for c in every], axis=1), model.noise) * scale
    gram, moment = model.beside(rows)
    # A Student distribution is a normal one of unknown width: where the recording needs more than
    # the usual size, a wider one costs as much as the tail.
    wide = limits.WIDER * np.abs(moment) / np.maximum(np.diag(gram), 1e-12)
    wide = np.maximum(wide, 1.0)
    prior = _odds(every)
    odds = prior - np.array([u.freedom for u in usual]) * np.log(wide)
    gram, moment, size = gram * np.outer(wide, wide), moment * wide, scale * wide
    null = np.array([c.amplitude.null or 0.0 for c in every])
    low = (np.array([c.amplitude.lowest for c in every]) - null) / size
    high = (np.array([c.amplitude.highest for c in every]) - null) / size
    own = 1.0 + np.maximum(np.diag(gram), 0.0)
    alone = np.clip(-moment / own, low, high)
    single = -(0.5 * own * alone**2 + moment * alone) - 0.5 * np.log(own) + odds
    ids, best = np.array([c.candidate.id for c in every]), np.argsort(-single)[:paired]
    i, j = (best[at] for at in np.triu_indices(len(best), 1))
    one = ids[i] == ids[j]
    legal = ~one
    # Two columns of one candidate are a pair if they are amplitudes of one permanent shape of it.
    legal[one] = [
        a.course is None
        and b.course is None
        and a.amplitude.id != b.amplitude.id
        and a.values == b.values
        for a, b in ((every[a], every[b]) for a, b in zip(i[one], j[one], strict=True))
    ]
    i, j, one = i[legal], j[legal], one[legal]
    both = gram[i, j]
    determinant = np.maximum(own[i] * own[j] - both**2, 1e-12)
    first = -(own[j] * moment[i] - both * moment[j]) / determinant
    second = -(own[i] * moment[j] - both * moment[i]) / determinant
    pair = -0.5 * (moment[i] * first + moment[j] * second + np.log(determinant))
    pair += odds[i] + odds[j] - np.where(one, prior[j], 0.0)
    inside = (first >= low[i]) & (first <= high[i]) & (second >= low[j]) & (second <= high[j])
    pair = np.where(inside, pair, -np.inf)
    cap = 4 * most
    sets = [(single[k], [(k, alone[k])]) for k in np.argsort(-single)[:cap]]
    sets += [(pair[k], [(i[k], first[k]), (j[k], second[k])]) for k in np.argsort(-pair)[:cap]]
    result: dict[Names, Proposal] = {}
    for score, members in sorted(sets, key=lambda s: -s[0]):
        if np.isfinite(score) and score > limits.WORTH_A_REFIT:
            begins = tuple((every[k], float(null[k] + at * size[k])) for k, at in members)
            found = Proposal(float(score), begins)
            result.setdefault(found.names, found)
    return list(result.values())[:most]


def _odds(every: Sequence[Column]) -> Array:
    """Prior log odds of each column, by its sort and the number of alternatives."""
    ways = Counter(c.candidate.id for c in every)
    each = [limits.SORT_ODDS[c.candidate.sort] - 0.5 * np.log(ways[c.candidate.id]) for c in every]
    return np.asarray(np.array(each) - np.log(len(ways)))


# Terms without a name: which of them contain which law or term, and their gain.


def holds(terms: Iterable[Term], slopes: Array) -> bool:
    """Is a law, by its slopes, shape (open rows,), a special case of some term?

    Differences within the error of form of the law do not count.
    """
    size = float(slopes @ slopes)
    for term in terms:
        left = slopes - term.columns @ np.linalg.lstsq(term.columns, slopes, rcond=None)[0]
        if float(left @ left) < limits.EFFECT_FORM**2 * size:
            return True
    return False


def beside(model: Model, every: Sequence[Term]) -> list[Term]:
    """The terms that neither contain nor are contained in a law or a term of a model."""
    laws = [slopes for candidate in model.setting.joined for slopes in slopes_of(model, candidate)]

    def whole(term: Term, other: Term) -> bool:
        """Does one term contain another, as at two places that show alike?"""
        return all(holds([term], column) for column in other.columns.T)

    return [
        term
        for term in every
        if not any(holds([term], slopes) for slopes in laws)
        and not any(whole(term, own) or whole(own, term) for own in model.terms)
    ]


def coincide(
    evidence: Evidence, model: Model, candidate: Candidate, other: Model, rival: Candidate
) -> bool:
    """Does an explanation of a model show the same as one of another model, with all else refitted?

    Differences within the errors of form of their laws do not count.
    """
    slopes, others = slopes_of(model, candidate), slopes_of(other, rival)
    if not (slopes and others):
        return not (slopes or others)
    own = [i for u in candidate.unknowns for i in indices_of(model, u.id)]
    rest = np.delete(np.arange(model.table.shape[1]), own)
    table, weights = model.table[:, rest], model.weights[:, None]
    normal = table.T @ (table * weights) + model.precision[np.ix_(rest, rest)]
    shown = evidence.whitened(np.stack([*slopes, *others], axis=1), model.noise)
    with np.errstate(all="ignore"):
        shown = shown - table @ np.linalg.solve(normal, table.T @ (shown * weights))
    shown = shown * np.sqrt(weights)
    first, second = shown[:, : len(slopes)], shown[:, len(slopes) :]
    left = second - first @ np.linalg.lstsq(first, second, rcond=None)[0]
    size = np.sum(second**2, axis=0)
    return bool(np.all(np.sum(left**2, axis=0) < limits.EFFECT_FORM**2 * size))


def indices_of(model: Model, unknown: str) -> list[int]:
    """Columns of an unknown, with all its levels, in the table of a model."""
    names = enumerate(model.prior.names)
    return [i for i, name in names if name.partition("#")[0] == unknown]


def slopes_of(model: Model, candidate: Candidate) -> list[Array]:
    """Slopes of the residuals by the amplitudes of a law, at its fitted values."""
    strengths = [u.id for u in candidate.unknowns if u.null is not None]
    columns = (model.raw[:, i] for name in strengths for i in indices_of(model, name))
    return [column for column in columns if np.any(column)]


def unnamed(
    evidence: Evidence, model: Model, every: Sequence[Term], most: int
) -> list[tuple[float, Term]]:
    """The terms that gain most beside a model, with their gain in log odds to first order, each
    with one over its driver that gains about as much and that a module type can hold."""
    found: list[tuple[float, Term]] = []
    for term in every:
        directions = directions_of(model, evidence.whitened(term.columns, model.noise))
        gain = float(np.max(term_gains(term, *directions, model.left[:, None])))
        count = len(every) * len(common.TERM_SIZES)
        odds = gain + limits.TERM_ODDS - term.basis.penalty - float(np.log(count))
        found.append((odds, term))
    found.sort(key=lambda f: -f[0])
    written = [f for f in found if f[1].changed.may_follow(f[1].driver)]
    chosen, near = found[:most], float(np.log(common.MENTIONED))
    for gain, term in found[:most]:
        alike = (f for f in written if f[1].driver == term.driver and f[0] > gain + near)
        one = next(alike, None)
        if one is not None and not any(one is other for other in chosen):
            chosen.append(one)
    return chosen


def directions_of(model: Model, columns: Array) -> tuple[Array, Array]:
    """Principal directions of whitened columns, shape (rows, functions), weighted, without what a
    model imitates of them, and the information of the rows on each, shape (functions, 1)."""
    alone = model.alone(columns)
    info, ways = np.linalg.eigh(columns.T @ alone)
    return alone @ ways, np.maximum(info, 0.0)[:, None]


def term_gains(term: Term, shown: Array, info: Array, left: Array) -> Array:
    """Gain of a term of each possible size, nats, shape (sizes, n), by its directions and whitened
    residuals, shape (rows, n)."""
    square = (shown.T @ left) ** 2
    gains = [square / (info + s**-2.0) - np.log1p(info * s**2) for s in common.TERM_SIZES]
    odds = np.array([[term.odds(size)] for size in common.TERM_SIZES])
    return np.asarray(0.5 * np.sum(gains, axis=1) + odds)
