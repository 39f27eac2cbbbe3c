"""Optima that lie far apart: recalibration that makes up for strong physics, ends of ranges."""

from __future__ import annotations

import numpy as np
import pytest

from rulec.mismatch.evidence.stores.drift import no_drift
from rulec.mismatch.evidence.stores.fit import Fitted, Judged
from rulec.mismatch.search.stores.search import search
from rulec.mismatch.search.stores.searcher import Searcher
from tests.runtime.mismatch.dynamic.benches import bench, made

LAG = "pump.lag-flow@pump"
STOP = "pump.pump-saturation@u"


def quiet(text: str) -> None:
    """Progress that nobody watches."""


@pytest.mark.prove
def test_a_lag_longer_than_the_tanks_remember_is_named() -> None:
    """Recalibrated tanks that look slow are far from the plant as it is stated."""
    found = search(bench(made(joined=(LAG,), more={f"{LAG}.tau": 120.0})), quiet)
    (name,) = found.best.ids
    assert "lag-flow" in name
    assert abs(found.best.values[f"{name}.tau"] - 120.0) < 5.0


@pytest.mark.prove
def test_what_ends_by_nature_is_no_stand_in() -> None:
    """A pump that follows no further at all has a strength at the end of its range."""
    values = {f"{STOP}.c": 1.0, f"{STOP}.s": 3.5}
    found = search(bench(made(joined=(STOP,), more=values)), quiet)
    assert (STOP,) == found.best.ids
    assert abs(found.best.values[f"{STOP}.s"] - 3.5) < 0.05


def test_what_is_said_of_one_tank_can_be_said_of_the_other() -> None:
    """Values and explanations change places with their namesakes; what has none stays."""
    there = bench(made())
    searcher = Searcher(there, Judged(there.known, {}, no_drift(there), np.zeros(0)), 1)
    body = next(c for c in there.candidates if c.id == "upper.displaced-volume@h")
    values = {"upper.k": 1.0, "lower.k": 2.0, f"{body.id}.p": 0.3, "pump.g": 4.0}
    none = np.zeros((0, 0))
    fitted = Fitted((body,), values, (), {}, {}, 0.0, none, np.zeros(0), {}, no_drift(there))
    turned = searcher._turned(fitted, {"upper": "lower", "lower": "upper"})
    assert turned.ids == ("lower.displaced-volume@h",)
    assert turned.values == {
        "upper.k": 2.0,
        "lower.k": 1.0,
        "lower.displaced-volume@h.p": 0.3,
        "pump.g": 4.0,
    }
