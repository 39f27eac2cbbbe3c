"""Replays of a recording by the plant's own model, and how often they tell what they hold."""

import numpy as np
import pytest

from rulec.mismatch.evidence.steady.evidence import settled
from rulec.mismatch.inference.judge import Judge
from rulec.mismatch.inference.power import asked_of, called_missing, drawn, judge_of, self_proof
from rulec.mismatch.search.grow_sets import join_columns
from rulec.mismatch.search.operating_states import begun
from rulec.mismatch.search.posterior import Posterior
from rulec.mismatch.search.simulated import begun as begun_with_stores
from tests.conftest import ROOT, Capsys
from tests.runtime.mismatch.dynamic.problems import OVERFLOW, made, problem_of
from tests.runtime.mismatch.made import SLIP, USUAL, Built, alone, rows_at, warmed
from tests.written import json_of

LEAK, LATE = "A.slip-linear@Q_geo", "A.valve-delay@Q_geo"
"""Both take off what is in proportion to pressure."""
REPLAYS = 200
HEALTHY = [str(ROOT / "plants" / "abc"), str(ROOT / "plants" / "abc" / "examples" / "healthy.csv")]


def warm(built: Built | None = None) -> Posterior:
    """A pump whose liquid warms up, with the plain model and the slip weighed."""
    search = begun(rows_at(alone(), warmed(built, 200)))
    plain = search.models[frozenset()]
    slip = [c for c in search.evidence.candidates if c.id == SLIP and built]
    join_columns(search, frozenset(), search.evidence.columns(plain.point, slip))
    return search.posterior()


@pytest.fixture(scope="module")
def judge() -> Judge:
    return judge_of(warm())


def columns_of(judge: Judge, candidate: str) -> list[int]:
    found = [i for i, c in enumerate(judge.columns) if c.name == candidate]
    assert found
    return found


def test_replays_scatter_as_the_model_says(judge: Judge) -> None:
    none = np.zeros((len(judge.model.left), 1))
    first = drawn(judge, 2000, none)
    assert np.array_equal(first, drawn(judge, 2000, none))
    assert called_missing(judge, first) < 100
    model = judge.model
    spread = model.table @ np.linalg.solve(model.precision, model.table.T)
    expected = np.sqrt(np.diag(spread) + 1.0 / model.weights)
    assert np.allclose(1.0, np.std(first, axis=1) / expected, atol=0.1)


def test_coinciding_explanations_are_told_as_one(judge: Judge) -> None:
    """A reading that is too high and one that is too low are no twins."""
    own = columns_of(judge, LEAK)
    size = 3.0 * float(judge.sizes[0][own[0]])
    assert judge.alike[np.ix_(own, columns_of(judge, LATE))].all()
    one, other = asked_of(judge, own, size, REPLAYS)
    assert one > 190
    assert other.total() < 10
    shift = judge.rows[:, own[:1]] * size
    judged = judge.judged(drawn(judge, REPLAYS, shift))
    for name in (LEAK, LATE):
        share = judged.columns[judge.owner == name].sum(axis=0)
        assert 0.1 < np.median(share) < 0.9
    high, low = columns_of(judge, "A.dp.high"), columns_of(judge, "A.dp.low")
    assert not judge.alike[np.ix_(high, low)].any()
    first, second = judge.rows[:, high[0]], judge.rows[:, low[0]]
    assert first @ second < -0.99 * np.linalg.norm(first) * np.linalg.norm(second)


def test_what_is_told_as_sure_is_right_as_often(judge: Judge) -> None:
    """Explanations drawn as likely as they are before, of sizes as they are before."""
    count, rng = 3000, np.random.default_rng(2)
    odds = np.exp(np.append(0.0, judge.odds))
    true = rng.choice(len(odds), count, p=odds / odds.sum()) - 1
    own, missing = np.maximum(true, 0), true >= 0
    sizes = np.array([_size(judge, i, rng) for i in own]) * missing
    shift = judge.rows[:, own] * sizes
    judged = named = judge.judged(drawn(judge, count, shift, seed=3))
    best = np.minimum(named.best, len(judge.columns) - 1)
    right = missing & (best == named.best)
    right &= (judge.owner[best] == judge.owner[own]) | judge.alike[best, own]
    assert named.sure.sum() > 50
    assert right[named.sure].mean() >= 0.85
    for low, high in ((0.0, 0.1), (0.1, 0.5), (0.5, 0.9), (0.9, 1.0)):
        here = (judged.nothing >= low) & (judged.nothing <= high)
        if here.any():
            chance = 3.0 * np.sqrt(0.25 / here.sum()) + 0.02
            assert abs(judged.nothing[here].mean() - (~missing[here]).mean()) < chance


def _size(judge: Judge, column: int, rng: np.random.Generator) -> float:
    """A size drawn from what is known before, within its range."""
    usual, width, freedom = (sizes[column] for sizes in judge.sizes)
    low, high = (end[column] for end in judge.ends)
    while True:
        size = float(rng.choice([-1.0, 1.0]) * usual + rng.standard_t(freedom) * width)
        if low <= size <= high:
            return size


def test_what_was_found_is_concealed_at_its_size() -> None:
    """As the set that has it says; what has no column in the recording is never told."""
    found = warm({SLIP: {"b": 0.1, "T0": USUAL}})
    every = settled(found.evidence).system.builder.candidates
    (effect,) = self_proof(found, every).effects
    assert (SLIP, "1/K", True) == (effect.id, effect.unit, effect.found)
    values = found.models[frozenset({SLIP})].setting.values
    assert effect.size == pytest.approx(values[f"{SLIP}.b"])
    assert effect.told > 190
    assert 1e-4 < effect.seen_from < effect.size
    (unseen,) = self_proof(found, every, ["A.cannot-be"]).effects
    assert (0, None) == (unseen.told, unseen.seen_from)
    assert np.isnan(unseen.size)


def test_command_tells_it_behind_the_report(capsys: Capsys) -> None:
    form = json_of("mismatch", *HEALTHY, "--power", "A.leakage", SLIP)
    assert ("none", [], "Nothing to do.") == tuple(form[k] for k in ("verdict", "effects", "next"))
    assert [] == form["repair"]["joined"]
    power = form["power"]
    assert REPLAYS == power["replays"]
    assert power["nothing"]["called_missing"] < 10
    leakage, slip = power["effects"]
    assert ("A.leakage", "%") == (leakage["id"], leakage["unit"])
    assert 0 < leakage["seen_from"] < leakage["size"]
    assert leakage["told"] > 100
    assert {"id", "title", "size", "unit", "told", "other", "seen_from"} <= leakage.keys()
    assert (SLIP, None, 0) == (slip["id"], slip["size"], slip["told"])
    story = " ".join(capsys.readouterr().out.split())
    count = power["nothing"]["called_missing"]
    assert f"something would be reported missing in {count} of 200 replays" in story
    assert f"identified in {leakage['told']} of 200 at its usual size" in story
    assert "no reading of this recording shows it" in story


def test_plants_that_store_are_replayed_too() -> None:
    problem = problem_of(made())
    proof = self_proof(begun_with_stores(problem).posterior(), problem.candidates, [OVERFLOW])
    (effect,) = proof.effects
    assert proof.called_missing < 10
    assert effect.told > 100
    assert 0 < effect.seen_from < effect.usual
