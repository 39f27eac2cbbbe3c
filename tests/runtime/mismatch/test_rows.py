"""Residuals as rows: they vanish where the relations hold, and show what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.simulation.equations import equations_of
from rulec.simulation.simulate import simulate_with
from tests.runtime.mismatch.made import (
    changed,
    opened,
    recorded,
    rows_at,
    sampled,
    solved,
    tour,
    without,
)

SAMPLES = 120


def errors(rows: Rows) -> Array:
    """Whitened errors at the plain setting."""
    return rows.errors(rows.system.flows(Configuration()))[0]


def abc(samples: int = SAMPLES, hold: int = 12, seed: int = 1) -> Recording:
    """A healthy recording with the parameters as stated."""
    given = tour(opened("abc")[0], samples, hold=hold)
    return recorded(opened("abc"), given, seed=seed, moved=False)


def quiet(plant: str) -> Recording:
    """Readings by the simulation, without any noise."""
    rules, _ = opened(plant)
    given = tour(rules, SAMPLES, 0.8, 1.1)
    found = simulate_with(equations_of(rules), given, {})
    assert found.solved.all()
    return sampled({**given, **found.values})


@pytest.mark.parametrize("plant", ["abc", "mixing-rig"])
def test_residuals_vanish_on_simulated_readings(plant: str) -> None:
    """What `rulec simulate` predicts obeys all relations; the unit is the noise of the sensors."""
    rows = rows_at(opened(plant), quiet(plant))
    assert len(rows) > 50
    assert float(np.abs(errors(rows)).max()) < 1e-3


@pytest.mark.parametrize("seed", [1, 2])
def test_rows_have_unit_noise(seed: int) -> None:
    """On a healthy recording with the parameters as stated, the scatter of each row is 1."""
    rows = rows_at(opened("abc"), abc(600, 60, seed))
    (cell,) = rows.cells
    table = cell.table(errors(rows)).T
    assert np.ones(cell.rank) == pytest.approx(table.std(axis=0), rel=0.15)


def test_as_many_rows_as_estimates_less_free_flows() -> None:
    """Seven estimates of two free flows leave five rows per point; outputs are no set values.
    Without a power reading there is one row less, and no estimate that needs it."""
    rows = rows_at(opened("abc"), abc())
    (cell,) = rows.cells
    assert 5 == cell.rank
    assert {"A.dp", "A.P_el", "B.dp", "B.P_el", "C.dp"} == set(cell.outputs)
    assert np.array_equal(rows.group_rank, rows.per_group(np.ones(len(rows))))
    assert np.array_equal(rows.group_point[rows.group], rows.point)
    fewer = rows_at(opened("abc"), without(abc(), "A.P_el"))
    assert [4] == [c.rank for c in fewer.cells]
    assert "A.power" not in fewer.system.number


def test_a_pump_that_stands_leaves_the_rest_comparable() -> None:
    """While B stands its estimates are not used, so A and the mixer are judged on their own."""
    rules, builder = opened("abc")
    values = solved(rules, builder, tour(rules, 240))
    stands = (np.arange(240) // 60) % 2 == 1
    still = {n: np.where(stands, 0.0, values[n]) for n in ("B.n", "B.P_el")}
    rows = rows_at(opened("abc"), changed(sampled(values), still))
    system = rows.system
    sets = {frozenset(system.observers[i].id for i in c.observers): c for c in rows.cells}
    assert frozenset(o.id for o in system.observers) in sets
    for names, cell in sets.items():
        if names & {"B.pump", "B.power"}:
            assert not np.any(system.data.values["B.n"][cell.points] == 0.0)
    assert any("A.pump" in s and "B.pump" not in s for s in sets)


def test_columns_are_derivatives_of_rows() -> None:
    """The slope of all rows by a parameter, against a finite difference where errors vanish; where
    a law has no slope at a point, a change of its values says nothing there."""
    rows = rows_at(opened("abc"), quiet("abc"))
    system, known = rows.system, opened("abc")[1].parameters
    flows = system.flows(Configuration(), known.ids)
    maps = rows.maps(flows)
    for name in ("A.C2", "A.k2", "B.eta", "C.k2"):
        i = known.ids.index(name)
        step = 1e-3 * np.sqrt(known.covariance[i, i])
        moved = Configuration(values={name: float(known.values[i] + step)})
        expected = (rows.errors(system.flows(moved))[0] - errors(rows)) / step
        found = rows.column(maps, flows.by_value[name])
        size = float(np.abs(expected).max())
        assert expected / size == pytest.approx(found / size, abs=2e-3), name
    ones = np.ones(len(system.data))
    steep = rows.column(maps, {0: np.where(np.arange(len(ones)) == 3, np.inf, ones)})
    assert np.isfinite(steep).all()
    assert np.abs(steep).max() <= np.abs(rows.column(maps, {0: ones})).max()
