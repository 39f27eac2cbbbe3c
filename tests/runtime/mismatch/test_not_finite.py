"""A model that has no number where a search begins ends nothing: it is left out."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from rulec.mismatch import stores
from rulec.mismatch.analyse import analyse
from rulec.mismatch.search.refit import climbed, refitted
from rulec.mismatch.search.settled.geometry import Geometry
from tests.runtime.mismatch.dynamic.benches import made, tanks
from tests.runtime.mismatch.made import alone, fitted, warmed


@pytest.mark.parametrize("fresh", [(), (0, 1)])
def test_a_climb_ends_where_there_are_no_numbers(fresh: tuple[int, ...]) -> None:
    """Whatever is compared with what is no number, nothing is more than it."""
    assert climbed(lambda place: np.nan, (1, 1), (3, 3), fresh) in {(1, 1), (0, 0)}
    beside = {(0, 0): 0.0, (1, 0): np.nan, (0, 1): 1.0, (1, 1): 2.0}
    assert climbed(lambda place: beside[place], (0, 1), (2, 2), ()) == (1, 1)


def test_a_refit_without_finite_slopes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those who try sets leave it out, and go on with the others."""
    start = fitted(alone(), warmed({}, 120))
    steep = SimpleNamespace(residual=start.residual, jacobian=np.full_like(start.jacobian, np.inf))
    monkeypatch.setattr(Geometry, "evaluated", lambda *_: steep)
    with pytest.raises(np.linalg.LinAlgError, match="no finite slopes"):
        refitted(Geometry(start.rows), start.setting)


def test_a_plant_that_runs_away_cannot_be_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sentence with a remedy instead of a traceback."""

    def runs_away(*args: object) -> None:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(stores, "search", runs_away)
    found = analyse(made(128), *tanks())
    assert "cannot judge" == found.verdict
    assert "runs away" in found.headline
