"""Of two laws that are left out in one module, both names may have to change at once."""

from __future__ import annotations

import functools

import pytest

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.screen import InitialCandidate, screen
from rulec.mismatch.search import exchange
from rulec.mismatch.search.accepted import Won
from rulec.mismatch.search.compete import CrossValidated, contest
from rulec.mismatch.search.exchange import exchanged, weighed
from tests.runtime.mismatch.made import alone, recorded, rows_at, tour

BUILT = {
    "A.speed-limit@n": {"a": 0.8, "n_c": 14.0},
    "A.windage@P_law": {"k": 0.3, "P0": 25.0, "n0": 13.0},
}
WRONG = "A.filling-loss@Q_geo", "A.viscous-friction@P_law"


@functools.cache
def trials() -> tuple[CrossValidated, dict[str, InitialCandidate]]:
    """The plain model of a recording with both laws, and all that may be missing in it."""
    rules, builder = alone()
    rows = rows_at(alone(), recorded(alone(), tour(rules, 240), BUILT))
    plain = fit(rows, Configuration(), rows.system.data.open)
    return contest(plain, None), {t.candidate.id: t for t in screen(plain, builder.candidates)}


def explained(*names: str) -> tuple[CrossValidated, tuple[Won, ...]]:
    """A model with some explanations; each has the one that was built in as its other."""
    plain, known = trials()
    setting = plain.fitted.setting
    for name in names:
        trial = known[name]
        setting = setting.joining(trial.candidate, trial.values, trial.fixed)
    model = contest(fit(plain.fitted.rows, setting, plain.fitted.used), known[names[0]])
    records = (
        Won(known[name], 1.0, (), (known[true],), (1e-9,))
        for name, true in zip(names, BUILT, strict=True)
    )
    return model, tuple(records)


def test_two_wrong_names_are_exchanged_together() -> None:
    """Either alone would be worse; those that had been named are the others then."""
    now, records = explained(*WRONG)
    better, found = exchanged(now, records)
    assert list(BUILT) == [r.trial.candidate.id for r in found]
    assert {c.id for c in better.fitted.setting.joined} == set(BUILT)
    assert better.gain_over(now) > 5.0
    for wrong, record in zip(WRONG, found, strict=True):
        assert wrong in [t.candidate.id for t in record.others]
        assert max(record.odds) < 1.0


@pytest.mark.parametrize("wrong", [0, 1])
def test_one_wrong_name_is_exchanged_beside_a_right_one(wrong: int) -> None:
    """It was chosen when the other was not there yet."""
    now, records = explained(*(WRONG[i] if i == wrong else n for i, n in enumerate(BUILT)))
    better, found = exchanged(now, records)
    assert list(BUILT) == [r.trial.candidate.id for r in found]
    assert better.gain_over(now) > 0.0
    assert WRONG[wrong] in [t.candidate.id for t in found[wrong].others]


def test_two_right_names_stay() -> None:
    """What is the best pair is not exchanged, and its others keep their odds."""
    now, records = explained(*BUILT)
    same, found = exchanged(now, records)
    assert (now, records) == (same, found)


def test_a_law_at_the_end_of_its_range_takes_no_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a real pump "all of the flow returns" had displaced two laws of friction."""
    true = next(iter(BUILT))
    monkeypatch.setattr(
        exchange, "at_an_end", lambda model, *laws: true in {law.id for law in laws}
    )
    now, records = explained(*WRONG)
    assert (now, records) == exchanged(now, records)
    _, known = trials()
    found = weighed(now, records[0], [known[n] for n in BUILT])
    assert [t for t in BUILT if t != true] == [t.candidate.id for t in found.others]


def test_odds_are_those_in_the_model_as_it_is() -> None:
    """What is there already is no other; the likeliest comes first."""
    now, records = explained(*BUILT)
    _, known = trials()
    names = [*WRONG, *BUILT, "A.copper-loss@P_law"]
    found = weighed(now, records[1], [known[n] for n in names])
    assert {*WRONG, "A.copper-loss@P_law"} == {t.candidate.id for t in found.others}
    assert sorted(found.odds, reverse=True) == list(found.odds)
