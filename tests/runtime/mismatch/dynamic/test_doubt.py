"""How sure it is that nothing is missing in a plant that stores, and what may be off all the
same."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from rulec.mismatch import analyse
from rulec.mismatch.answer.verdict import verdict_of
from rulec.mismatch.evidence.stores.fit import Fitter, plain_end
from rulec.mismatch.search import posterior as of_search
from rulec.mismatch.search.posterior import posterior
from rulec.mismatch.stores import Explanation, explanation, prove
from rulec.mismatch.structure.structure_search import Structure
from tests.runtime.mismatch.dynamic.benches import NOISE, TRUE, bench, explained, made


@pytest.fixture
def plain() -> Explanation:
    """The plain model of a sound plant."""
    recording = made(256)
    place = bench(recording)
    ends, fitted = plain_end(place, TRUE)
    fitted = Fitter(place, (), {}).with_covariance(fitted, ends.judged)
    return explained(recording, place, ends, fitted, fitted)


def verdict(said: Explanation, off: float = 0.0) -> str:
    """With readings that are off by so much, V."""
    own = said.model.fitted
    moved = replace(own, errors={n: e + off for n, e in own.errors.items()})
    (proof,) = prove(said.model.bench, own, moved, said.model.judged)
    doubt = analyse._doubt(said, [proof.fit])
    return verdict_of((), False, doubt)


def test_a_sound_plant_gets_its_tick_and_none_where_more_is_left(plain: Explanation) -> None:
    """Noise is left, as is what sensors within their class and laws within their accuracy do; what
    no law within its accuracy explains is missing, whether it has a name or not."""
    assert plain.nothing > 0.9
    assert 5.0 * NOISE < plain.allowed["lower.y"] < 0.5
    said = [verdict(plain, share * plain.allowed["lower.y"]) for share in (0.0, 0.8, 1.5)]
    assert ["none", "none", "unsure"] == said


@pytest.mark.parametrize(("more", "expected"), [(-3.0, "none"), (0.0, "unsure")])
def test_no_tick_where_an_explanation_gains(
    plain: Explanation, more: float, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that shows, and is as likely as nothing."""
    was = plain.found.posterior
    none, other = frozenset[str](), frozenset({"pump.x"})
    shown: Any = SimpleNamespace(terms=())
    monkeypatch.setattr(
        of_search, "Tolerance", lambda evidence, model: SimpleNamespace(shows=1.0, within=none)
    )
    odds = {none: was.odds[none], other: was.odds[none] + more}
    now = posterior(was.evidence, {**was.models, other: shown}, odds)
    found = replace(plain.found, posterior=now)
    assert expected == verdict(explanation(plain.recording, plain.model, found))


@pytest.mark.parametrize(("recorded", "kept"), [(-2.0, True), (-0.9, False)])
def test_a_clock_is_corrected_only_if_the_explanation_is_likelier_with_it(
    monkeypatch: pytest.MonkeyPatch, recorded: float, kept: bool
) -> None:
    """A clock is judged by the plain model: a delay of the plant may undo a wrong correction."""
    plain = Structure(made(64), cast(Any, None), ())
    corrected = replace(plain, unshifted=plain)
    each = {id(corrected): -1.0, id(plain): recorded}

    def read_as(read: Structure, *_: object) -> Any:
        return SimpleNamespace(accepted=("a delay",), evidence_per_row=lambda: (each[id(read)], 64))

    monkeypatch.setattr(analyse, "_explained", read_as)
    found, _ = analyse._likelier_read(corrected, (), lambda text: None)
    assert found is (corrected if kept else plain)
