"""What a search finds in tanks, how sure it is that nothing is missing, and what has no name."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from rulec.mismatch import analyse
from rulec.mismatch.answer.verdict import verdict_of
from rulec.mismatch.evidence.stores.fit import Fitter, plain_end
from rulec.mismatch.search import posterior as of_search
from rulec.mismatch.search.posterior import posterior
from rulec.mismatch.search.simulated import begun, curves_of, likeliest_curve, search
from rulec.mismatch.stores import Explanation, explanation, prove
from rulec.mismatch.structure.structure_search import Structure
from tests.runtime.mismatch.dynamic.benches import (
    NOISE,
    OVERFLOW,
    RIM,
    TRUE,
    bench,
    explained,
    grow_by,
    made,
    searched,
    voltage,
)
from tests.runtime.mismatch.made import changed

LOST_FLOW = "upper.overflow-lost@inflow"


def test_a_sound_plant_is_recalibrated_to_its_noise() -> None:
    """Zero and gain of a sensor within its class are no physics."""
    recording = made(seed=3)
    y = recording.values["lower.y"] * 1.002 + 0.02
    found = search(bench(changed(recording, {"lower.y": y})), lambda text: None)
    (noise,) = found.plain.noise.values()
    assert not found.best.joined
    assert frozenset() == found.posterior.best
    assert noise.spread == pytest.approx(NOISE, rel=0.1)
    assert noise.memory < 1.3


def test_a_law_is_found_although_its_special_case_fits() -> None:
    """An overflow that is caught holds one that is lost, and recalibration makes up for much."""
    found = begun(bench(made(joined=(OVERFLOW,), more=RIM)))
    grow_by(found, OVERFLOW, LOST_FLOW)
    own = frozenset({OVERFLOW})
    assert own == found.likeliest
    assert found.odds[own] > found.odds[frozenset({LOST_FLOW})] + 10.0
    values = found.models[own].setting.values
    assert values[f"{OVERFLOW}.f"] == pytest.approx(RIM[f"{OVERFLOW}.f"], abs=0.1)


@pytest.mark.prove
@pytest.mark.parametrize(
    ("built", "named", "more", "value", "off"),
    [
        # Recalibrated tanks that look slow are far from the plant as it is stated.
        ("pump.lag-flow@pump", "lag-flow", {"tau": 120.0}, "tau", 5.0),
        # A pump that follows no further at all has a strength at the end of its range.
        ("pump.pump-saturation@u", "pump.pump-saturation@u", {"c": 1.0, "s": 3.5}, "s", 0.05),
    ],
)
def test_what_recalibration_makes_up_for_is_named(
    built: str, named: str, more: dict[str, float], value: str, off: float
) -> None:
    own = {f"{built}.{name}": number for name, number in more.items()}
    found = search(bench(made(joined=(built,), more=own)), lambda text: None)
    (name,) = found.best.ids
    assert named in name
    assert abs(found.best.values[f"{name}.{value}"] - more[value]) < off


@pytest.fixture
def plain() -> Explanation:
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
    """What no law within its accuracy explains is missing, whether it has a name or not."""
    assert plain.nothing > 0.9
    assert 5.0 * NOISE < plain.allowed["lower.y"] < 0.5
    said = [verdict(plain, share * plain.allowed["lower.y"]) for share in (0.0, 0.8, 1.5)]
    assert ["none", "none", "unsure"] == said


@pytest.mark.parametrize(("more", "expected"), [(-3.0, "none"), (0.0, "unsure")])
def test_no_tick_where_an_explanation_gains(
    plain: Explanation, more: float, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
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


LOSS = "lower.store-loss@inflow"


def test_a_flow_that_no_entry_names_follows_what_it_follows() -> None:
    """A jet that misses the first tank at high flow: a flow from tank to tank, as the pump runs."""
    missed = 0.6 * TRUE["pump.k"] * np.maximum(voltage(384, 1) - 3.0, 0.0)
    place = bench(made(384, errors={"definition:upper.outflow": missed}))
    unnamed = likeliest_curve(searched(place, LOSS))
    assert unnamed.curve.driver == "pump.u"
    assert unnamed.curve.place.module in ("upper", "lower")
    assert unnamed.share > 1.0 - 0.7**2


def test_a_reading_that_no_entry_names_is_a_curve_for_a_plant_file() -> None:
    """A bump of a transmitter's characteristic, drawn over the level with a few points."""
    level = made(384).values["lower.y"]
    middle = float(np.median(level))
    bump = 0.6 * np.exp(-(((level - middle) / 0.7) ** 2))
    place = bench(made(384, errors={"reading:lower.y": bump}))
    (curve,) = curves_of(searched(place, LOSS))
    assert ("reading:lower.y", "lower.h") == (curve.place, curve.driver)
    h, shown = np.array(curve.points).T
    assert h[np.argmax(shown)] == pytest.approx((middle - TRUE["lower.y0"]) / TRUE["lower.g"], 0.05)
    assert max(shown) - 0.5 * (shown[0] + shown[-1]) == pytest.approx(0.6, abs=0.15)
