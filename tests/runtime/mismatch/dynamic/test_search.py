"""What a search finds in tanks: what is true, although recalibration, special cases, or optima far
apart make up for it, and no more than that."""

from __future__ import annotations

import pytest

from rulec.mismatch.search.grow_sets import Search
from rulec.mismatch.search.simulated import Found, begun, search
from tests.runtime.mismatch.dynamic.benches import NOISE, OVERFLOW, RIM, bench, grow_by, made
from tests.runtime.mismatch.made import changed

BAND, LAMINAR = "pump.pump-dead-band@u", "lower.line-laminar@outflow"
LOST, LINEAR = "upper.overflow-lost@inflow", "upper+lower.outlet-linear@outflow"
LAG, STOP = "pump.lag-flow@pump", "pump.pump-saturation@u"


def whole(joined: tuple[str, ...], more: dict[str, float]) -> Found:
    """The whole search."""
    return search(bench(made(joined=joined, more=more)), lambda text: None)


def grown(joined: tuple[str, ...], more: dict[str, float], *of: str, seed: int = 1) -> Search:
    """What stands beside the plain model, of some candidates."""
    found = begun(bench(made(512, seed, joined=joined, more=more)))
    grow_by(found, *of)
    return found


def test_a_sound_plant_is_recalibrated_to_its_noise() -> None:
    """The error that remains is white and as large as the noise; nothing is claimed, and nothing
    is likelier. Zero and gain of a sensor within its class are no physics."""
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
    found = grown((OVERFLOW,), RIM, OVERFLOW, LOST)
    own = frozenset({OVERFLOW})
    assert own == found.likeliest
    assert found.odds[own] > found.odds[frozenset({LOST})] + 10.0
    values = found.models[own].setting.values
    assert values[f"{OVERFLOW}.f"] == pytest.approx(RIM[f"{OVERFLOW}.f"], abs=0.1)


@pytest.mark.prove
def test_a_lag_longer_than_the_tanks_remember_is_named() -> None:
    """Recalibrated tanks that look slow are far from the plant as it is stated."""
    found = whole((LAG,), {f"{LAG}.tau": 120.0})
    (name,) = found.best.ids
    assert "lag-flow" in name
    assert abs(found.best.values[f"{name}.tau"] - 120.0) < 5.0


@pytest.mark.prove
def test_what_ends_by_nature_is_no_stand_in() -> None:
    """A pump that follows no further at all has a strength at the end of its range."""
    found = whole((STOP,), {f"{STOP}.c": 1.0, f"{STOP}.s": 3.5})
    assert (STOP,) == found.best.ids
    assert abs(found.best.values[f"{STOP}.s"] - 3.5) < 0.05
