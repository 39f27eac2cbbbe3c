"""The order of the search: what was chosen one by one is held against two chosen together."""

from __future__ import annotations

import pytest

from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.search.accepted import Won
from rulec.mismatch.search.compete import contest
from rulec.mismatch.search.search import Search, _or_begun_with_two
from tests.runtime.mismatch.test_exchange import BUILT, WRONG, trials

MORE = "A.slip-linear@Q_geo"


def quiet(text: str) -> None:
    """Nobody watches."""


def chain(*names: str) -> Search:
    """What a search would have found."""
    plain, known = trials()
    fitted, setting = plain.fitted, plain.fitted.setting
    for name in names:
        setting = setting.joining(known[name].candidate, known[name].values, known[name].fixed)
    best = contest(fit(fitted.rows, setting, fitted.used), known[names[0]])
    records = tuple(Won(known[name], 1.0, (), (), ()) for name in names)
    return Search(plain, best, records, 50)


@pytest.mark.prove
def test_two_that_say_more_than_many_are_told_instead() -> None:
    """Three wrong names give way to two; each of those that were built in is told or left open."""
    found = _or_begun_with_two(trials()[0], chain(*WRONG, MORE), quiet)
    assert 2 == len(found.accepted)
    for record in found.accepted:
        open_ = [t.candidate.id for t, o in zip(record.others, record.odds, strict=True) if o > 0.5]
        assert set(BUILT) & {record.trial.candidate.id, *open_}
    assert {c.id for c in found.best.fitted.setting.joined} == {
        r.trial.candidate.id for r in found.accepted
    }


def test_a_few_names_are_not_asked_again() -> None:
    """That is for what only many names together explain."""
    short = chain(*WRONG)
    assert _or_begun_with_two(trials()[0], short, quiet) is short
