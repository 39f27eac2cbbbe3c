"""What has no name in a plant that stores: its place, and what it follows."""

from __future__ import annotations

import numpy as np
import pytest

from rulec.mismatch.search.simulated import curves_of, likeliest_curve
from tests.runtime.mismatch.dynamic.benches import TRUE, bench, made, searched, voltage

LOSS = "lower.store-loss@inflow"


def test_a_flow_that_no_entry_names_follows_what_it_follows() -> None:
    """A jet that misses the first tank at high flow: a flow from tank to tank, as the pump runs."""
    missed = 0.6 * TRUE["pump.k"] * np.maximum(voltage(384, 1) - 3.0, 0.0)
    place = bench(made(384, errors={"definition:upper.outflow": missed}))
    unnamed = likeliest_curve(searched(place, LOSS))
    assert unnamed is not None
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
