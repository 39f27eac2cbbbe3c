"""Something is wrong somewhere, whatever explains it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.evidence.stores.drift import no_drift
from rulec.mismatch.evidence.stores.fit import Judged
from rulec.mismatch.evidence.stores.locate import Suspect
from rulec.mismatch.evidence.stores.model import model_of
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.search.stores.nonparametric_term import or_nameless
from rulec.mismatch.search.stores.searcher import Searcher
from rulec.mismatch.stores import nameless_places
from tests.runtime.mismatch.dynamic.benches import NOISE, OVERFLOW, RIM, TRUE, bench, made, voltage


@pytest.mark.parametrize(
    ("share", "times", "places"),
    [
        (0.6, 1.5, ["upper.h"]),
        (0.1, 1.5, []),  # no place explains it, and it may be noise of another kind
        (0.1, 20.0, ["upper.h"]),  # no straight way back leads from so far
    ],
)
def test_a_model_that_is_far_off_has_a_place(share: float, times: float, places: list[str]) -> None:
    place = bench(made())
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = replace(searcher.plain(), noise={"lower.y": Noise(times * NOISE, 5.0)})
    spot = next(s for s in place.builder.spots if s.id == "balance:upper.h")
    left = [Suspect(spot, np.ones(len(place.time)), 100.0, share)]
    model = model_of(place, plain, searcher.judged, {})
    found = nameless_places(model, left, len(place.candidates))
    assert places == [f"{p.module}.{p.place}" for p in found]


SAMPLES = 384


def test_a_flow_that_no_entry_names_follows_what_it_follows() -> None:
    """A jet that misses the first tank at high flow: a flow from tank to tank, as the pump runs."""
    u = voltage(SAMPLES, 1)
    missed = 0.6 * TRUE["pump.k"] * np.maximum(u - 3.0, 0.0)
    place = bench(made(SAMPLES, errors={"definition:upper.outflow": missed}))
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = searcher.plain()
    searcher = Searcher(place, replace(searcher.judged, noise=plain.noise), 2)
    found = or_nameless(searcher, plain, [plain], len(place.candidates))
    (law,) = found.joined
    assert ("free", {"pump.u"}) == (law.sort, set(law.drivers.values()))
    assert law.module in ("upper", "lower")
    assert found.noise["lower.y"].spread < 0.7 * plain.noise["lower.y"].spread


def test_a_right_name_stays() -> None:
    """A curve pays for each of its values, and explains no more."""
    place = bench(made(SAMPLES, joined=(OVERFLOW,), more=RIM))
    searcher = Searcher(place, Judged(place.known, {}, no_drift(place), np.zeros(0)), 2)
    plain = searcher.plain()
    searcher = Searcher(place, replace(searcher.judged, noise=plain.noise), 2)
    named = searcher.polished(searcher.trial(plain, (place.candidate(OVERFLOW),)))
    assert searcher.gain(named, plain) > 50.0
    assert named is or_nameless(searcher, named, [plain], len(place.candidates))
