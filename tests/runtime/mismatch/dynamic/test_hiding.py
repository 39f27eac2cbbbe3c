"""Two explanations that hide each other in tanks, and how they are found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec.mismatch.evidence.stores.drift import drift_of, no_drift
from rulec.mismatch.evidence.stores.fit import Fitted, Judged
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.search.stores.masked_pair import hiding_pairs
from rulec.mismatch.search.stores.nested_models import with_kin
from rulec.mismatch.search.stores.search import _carried
from rulec.mismatch.search.stores.searcher import Searcher
from tests.runtime.mismatch.dynamic.benches import OVERFLOW, RIM, bench, made

BAND, LAMINAR = "pump.pump-dead-band@u", "lower.line-laminar@outflow"
HIDDEN = {f"{BAND}.d": 0.1, f"{LAMINAR}.a": 1e-6}
LOST = "upper.overflow-lost@inflow"


def begun(joined: tuple[str, ...], more: dict[str, float]) -> tuple[Searcher, Fitted]:
    """A search that has its plain model, of a recording with something left out."""
    place = bench(made(512, joined=joined, more=more))
    rough = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = rough.plain()
    drift = drift_of(place, (), plain.values)
    searcher = Searcher(place, Judged(place.known, plain.noise, drift, np.zeros(drift.count)), 2)
    return searcher, searcher.polished(replace(plain, slow=searcher.judged.slow, drift=drift))


def test_a_pair_shows_where_one_of_it_shows_nothing() -> None:
    """A pump that starts late gains less than its price, and leads with what hides it."""
    searcher, plain = begun((BAND, LAMINAR), HIDDEN)
    single = [c for c in searcher.bench.candidates if not c.members]
    band = searcher.polished(searcher.trial(plain, (searcher.bench.candidate(BAND),)))
    assert searcher.gain(band, plain) < 0.0
    pairs = [{c.id for c in joined} for _, joined in hiding_pairs(searcher, plain, single, 5.0)]
    assert any(BAND in pair for pair in pairs)
    assert not hiding_pairs(searcher, plain, single, 1e6)


def test_where_nothing_is_missing_no_pair_is_fitted() -> None:
    """Noise is no pair."""
    searcher, plain = begun((), {})
    single = [c for c in searcher.bench.candidates if not c.members]
    assert not hiding_pairs(searcher, plain, single, 8.0)


def test_a_law_is_begun_from_its_special_case() -> None:
    """An overflow that is caught holds one that is lost, and is found from where that stands."""
    searcher, plain = begun((OVERFLOW,), RIM)
    lost = searcher.polished(searcher.trial(plain, (searcher.bench.candidate(LOST),)))
    single = [c for c in searcher.bench.candidates if not c.members]
    found = {f.ids: f for f in with_kin(searcher, [lost], single, plain)}
    assert {(LOST,), (OVERFLOW,)} == set(found)
    caught = found[OVERFLOW,]
    assert searcher.gain(caught, plain) > searcher.gain(lost, plain) + 10.0
    assert abs(caught.values[f"{OVERFLOW}.f"] - RIM[f"{OVERFLOW}.f"]) < 0.1


class Ranked:
    """Stands in for a search: what models gain is written on them."""

    def gain(self, fitted: Fitted, plain: Fitted) -> float:
        """In place of the likelihood."""
        return fitted.negative_log_prior


def test_the_whitest_are_carried_along() -> None:
    """Models that gain most stand below others where prices decide, and are kept all the same."""
    place = bench(made(64))
    none, noise = np.zeros((0, 0)), {"lower.y": Noise(1.0, 1.0)}
    random = np.random.default_rng(0)

    def model(number: int, gain: float) -> Fitted:
        errors = {"lower.y": random.standard_normal(64)}
        joined = (place.candidates[number],)
        drift = no_drift(place)
        return Fitted(joined, {}, (), noise, errors, gain, none, np.zeros(0), {}, drift)

    ranked = [model(i, gain) for i, gain in enumerate([1.0] * 8 + [9.0, 5.0, 7.0])]
    kept = _carried(Ranked(), ranked, ranked[0], 3)  # type: ignore[arg-type]
    assert [ranked[i].ids for i in (0, 1, 2, 8, 10)] == [f.ids for f in kept]
