"""Optima that lie far apart: recalibration that makes up for strong physics, ends of ranges."""

from __future__ import annotations

import pytest

from rulec.mismatch.search.stores.best_set import search
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
