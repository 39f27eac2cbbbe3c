"""Replays of a recording by the plant's own model, and how often they tell what they hold."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main
from rulec.mismatch.inference.judge import Judge, replay_verdicts
from rulec.mismatch.inference.power import asked_of, called_missing, judge_of, self_proof
from rulec.mismatch.inference.replay import Replayer
from rulec.mismatch.search.settled.scan import columns, scan
from rulec.mismatch.search.settled.sets import Posterior, _join, begun
from rulec.mismatch.search.stores import sets as of_stores
from tests.conftest import ROOT
from tests.runtime.mismatch.dynamic.benches import OVERFLOW, bench, made
from tests.runtime.mismatch.made import (
    USUAL,
    Built,
    alone,
    recorded,
    rows_at,
    tour,
    warming,
)

SLIP = "A.slip-temperature@Q_geo"
LEAK, LATE = "A.slip-linear@Q_geo", "A.valve-delay@Q_geo"
"""Both take off what is in proportion to pressure."""
REPLAYS = 200
ABC = ROOT / "plants" / "abc"


def warm(built: Built | None = None) -> Posterior:
    """A pump whose liquid warms up, with the plain model and the slip weighed."""
    given = {**tour(alone()[0], 200), "A.T": warming(200)}
    rows = rows_at(alone(), recorded(alone(), given, built))
    search = begun(rows)
    plain = search.models[frozenset()]
    every = columns(search.settled, plain, search.alike) if built else []
    for found in scan(search.settled, plain, every, search.alike, 8, {SLIP}):
        _join(search, frozenset(), found)
    return search.posterior()


@pytest.fixture(scope="module")
def judge() -> Judge:
    return judge_of(warm())


def columns_of(judge: Judge, candidate: str) -> list[int]:
    found = [i for i, c in enumerate(judge.columns) if c.name == candidate]
    assert found
    return found


def none(judge: Judge) -> np.ndarray:
    return np.zeros((len(judge.model.left), 1))


def test_nothing_missing_is_hardly_ever_called_missing(judge: Judge) -> None:
    replays = Replayer(judge.geometry, judge.model).drawn(1000, none(judge))
    assert called_missing(judge, replays) < 50


def test_replays_are_the_same_each_time(judge: Judge) -> None:
    """And scatter as the model says: noise, and all that may be off."""
    replayer = Replayer(judge.geometry, judge.model)
    first = replayer.drawn(2000, none(judge))
    assert np.array_equal(first, replayer.drawn(2000, none(judge)))
    model = judge.model
    spread = model.table @ np.linalg.solve(model.precision, model.table.T)
    # A Student distribution with four degrees of freedom has twice its scale's variance.
    expected = np.sqrt(np.diag(spread) + 2.0 * model.scale**2)
    assert np.allclose(1.0, np.std(first, axis=1) / expected, atol=0.25)


@pytest.mark.parametrize(("size", "least", "most"), [(0.2, 190, 200), (1e-4, 0, 4)])
def test_strong_is_told_and_tiny_is_not(judge: Judge, size: float, least: int, most: int) -> None:
    """Slip that follows the temperature, per kelvin."""
    told, other = asked_of(judge, columns_of(judge, SLIP), size, REPLAYS)
    assert least <= told <= most
    assert other.total() < 10


def test_coinciding_explanations_are_told_as_one(judge: Judge) -> None:
    """Each has a share that is not sure, both together are told, and neither counts as wrong where
    the other one is true."""
    own, size = columns_of(judge, LEAK), 3.0 * float(judge.sizes[0][columns_of(judge, LEAK)[0]])
    assert judge.alike[np.ix_(own, columns_of(judge, LATE))].all()
    told, other = asked_of(judge, own, size, REPLAYS)
    assert told > 190
    assert other.total() < 10
    judged = judge.judged(
        Replayer(judge.geometry, judge.model).drawn(REPLAYS, judge.rows[:, own[:1]] * size)
    )
    for name in (LEAK, LATE):
        share = judged.columns[judge.owner == name].sum(axis=0)
        assert 0.1 < np.median(share) < 0.9


def test_what_shows_the_other_way_round_is_no_twin(judge: Judge) -> None:
    """A reading that is too high, and one that is too low: neither may have the other sign."""
    high, low = columns_of(judge, "A.dp.high"), columns_of(judge, "A.dp.low")
    assert not judge.alike[np.ix_(high, low)].any()
    first, second = judge.rows[:, high[0]], judge.rows[:, low[0]]
    assert first @ second < -0.99 * np.linalg.norm(first) * np.linalg.norm(second)


def test_what_is_told_as_sure_is_right_as_often(judge: Judge) -> None:
    """Explanations drawn as likely as they are before, of sizes as they are before."""
    count, rng = 3000, np.random.default_rng(2)
    odds = np.exp(np.append(0.0, judge.odds))
    drawn = rng.choice(len(odds), count, p=odds / odds.sum()) - 1
    own, missing = np.maximum(drawn, 0), drawn >= 0
    sizes = np.array([_size(judge, i, rng) for i in own]) * missing
    shift = judge.rows[:, own] * sizes
    judged = judge.judged(Replayer(judge.geometry, judge.model).drawn(count, shift, seed=3))
    told = replay_verdicts(judge, judged)
    best = np.minimum(told.best, len(judge.columns) - 1)
    right = missing & (best == told.best)
    right &= (judge.owner[best] == judge.owner[own]) | judge.alike[best, own]
    assert told.sure.sum() > 50
    assert right[told.sure].mean() >= 0.85
    for low, high in ((0.0, 0.1), (0.1, 0.5), (0.5, 0.9), (0.9, 1.0)):
        here = (judged.nothing >= low) & (judged.nothing <= high)
        chance = 3.0 * np.sqrt(0.25 / max(here.sum(), 1)) + 0.02
        assert (
            here.sum() == 0 or abs(judged.nothing[here].mean() - (~missing[here]).mean()) < chance
        )


def _size(judge: Judge, column: int, rng: np.random.Generator) -> float:
    """A size drawn from what is known before, within its range."""
    usual, width, freedom = (known[column] for known in judge.sizes)
    low, high = (end[column] for end in judge.ends)
    while True:
        size = float(rng.choice([-1.0, 1.0]) * usual + rng.standard_t(freedom) * width)
        if low <= size <= high:
            return size


def test_what_was_found_is_concealed_at_its_size() -> None:
    """As the set that has it says; what has no column in the recording is never told."""
    found = warm({SLIP: {"b": 0.1, "T0": USUAL}})
    values = found.models[frozenset({SLIP})].setting.values
    every = found.settled.rows.system.builder.candidates
    (seen,) = self_proof(found, every).effects
    assert (SLIP, "1/K", True) == (seen.id, seen.unit, seen.found)
    assert seen.size == pytest.approx(values[f"{SLIP}.b"])
    assert seen.told > 190
    assert seen.seen_from is not None
    assert seen.seen_from < seen.size
    (unseen,) = self_proof(found, every, ["A.cannot-be"]).effects
    assert (0, None) == (unseen.told, unseen.seen_from)
    assert np.isnan(unseen.size)


def test_command_tells_it_behind_the_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In words and in the JSON, where asked for."""
    given = ["mismatch", str(ABC), str(ABC / "examples" / "healthy.csv")]
    file = tmp_path / "m.json"
    assert 0 == main([*given, "--json", str(file)])
    assert "power" not in json.loads(file.read_text(encoding="utf-8"))
    assert "With nothing missing" not in capsys.readouterr().out
    assert 0 == main([*given, "--power", "A.leakage", SLIP, "--json", str(file)])
    power = json.loads(file.read_text(encoding="utf-8"))["power"]
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
    assert f"something would be called missing in {count} of 200 replays" in story
    assert f"told in {leakage['told']} of 200 at its usual size" in story
    assert "no reading of this recording shows it" in story


def test_ids_that_nothing_has_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    """Before the search, with what may be meant."""
    given = ["mismatch", str(ABC), str(ABC / "examples" / "healthy.csv")]
    assert 1 == main([*given, "--power", "A.leak"])
    said = "--power A.leak: no effect of this plant has that id; did you mean A.leakage?"
    assert said in capsys.readouterr().err


def test_plants_that_store_are_replayed_too() -> None:
    """A strong overflow is told, and nothing is called missing where nothing is."""
    place = bench(made())
    found = of_stores.begun(place).posterior()
    proof = self_proof(found, place.candidates, [OVERFLOW])
    assert proof.called_missing < 10
    (seen,) = proof.effects
    assert "Overflow, a part caught by what lies below in upper" == seen.title
    assert seen.told > 100
    assert seen.seen_from is not None
    assert 0 < seen.seen_from < seen.usual
