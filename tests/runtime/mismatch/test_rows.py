"""Residuals as rows: they vanish where the relations hold, and show what is left out."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import System
from rulec.simulation.equations import equations_of
from rulec.simulation.simulate import simulate_with
from tests.runtime.mismatch.made import (
    alone,
    opened,
    recorded,
    rows_at,
    solved,
    tour,
    without,
)
from tests.runtime.mismatch.rescaled import Rescaled

SAMPLES = 120


def errors(rows: Rows) -> Array:
    """Whitened errors at the plain setting."""
    return rows.errors(rows.system.flows(Configuration()))[0]


def quiet(plant: str) -> Recording:
    """Readings by the simulation, without any noise."""
    rules, _ = opened(plant)
    given = tour(rules, SAMPLES, 0.8, 1.1)
    found = simulate_with(equations_of(rules), given, {})
    assert found.solved.all()
    n = np.arange(SAMPLES, dtype=float)
    return Recording(
        time=n,
        values={**given, **found.values},
        segment=np.zeros(SAMPLES, dtype=int),
        missing=(),
        notes=(),
    )


@pytest.mark.parametrize("plant", ["abc", "mixing-rig"])
def test_residuals_vanish_on_simulated_readings(plant: str) -> None:
    """What `rulec simulate` predicts obeys all relations; the unit is the noise of the sensors."""
    rows = rows_at(opened(plant), quiet(plant))
    assert len(rows) > 50
    assert float(np.abs(errors(rows)).max()) < 1e-3


def test_recordings_made_here_are_those_of_the_simulation() -> None:
    """Two ways to the same operating points, to 1e-12."""
    rules, builder = opened("abc")
    given = tour(rules, 60)
    found = solved(rules, builder, given)
    expected = simulate_with(equations_of(rules), given, {}).values
    for name, values in expected.items():
        assert values == pytest.approx(found[name], rel=1e-12), name


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rows_have_unit_noise(seed: int) -> None:
    """On a healthy recording with the parameters as stated, the scatter of each row is 1."""
    rules, _ = opened("abc")
    given = tour(rules, 600, hold=60)
    rows = rows_at(opened("abc"), recorded(opened("abc"), given, seed=seed, moved=False))
    (cell,) = rows.cells
    table = cell.table(errors(rows)).T
    assert np.ones(cell.rank) == pytest.approx(table.std(axis=0), rel=0.15)


def test_as_many_rows_as_estimates_less_free_flows() -> None:
    """Seven estimates of two free flows leave five rows per point; outputs are no set values."""
    rules, _ = opened("abc")
    (cell,) = rows_at(opened("abc"), recorded(opened("abc"), tour(rules, SAMPLES))).cells
    assert 5 == cell.rank
    assert {"A.dp", "A.P_el", "B.dp", "B.P_el", "C.dp"} == set(cell.outputs)


@pytest.mark.parametrize("factor", [1e-3, 7.0, 1e4])
def test_rescaling_a_relation_changes_nothing(factor: float) -> None:
    """An estimate times a number is told as the same error of the same reading."""
    rules, builder = alone()
    recording = recorded(alone(), tour(rules, SAMPLES))
    data = prepare(recording, rules)
    assert data is not None
    plain = rows_of(System(rules, builder, data), Configuration())
    scaled = rows_of(System(rules, Rescaled(builder, factor), data), Configuration())
    assert errors(plain) == pytest.approx(errors(scaled), rel=1e-6, abs=1e-6)


def test_a_pump_that_stands_leaves_the_rest_comparable() -> None:
    """While B stands its estimates are not used, so A and the mixer are judged on their own."""
    rules, builder = opened("abc")
    given = tour(rules, 240)
    stands = (np.arange(240) // 60) % 2 == 1
    values = dict(solved(rules, builder, given))
    values["B.n"] = np.where(stands, 0.0, values["B.n"])
    values["B.P_el"] = np.where(stands, 0.0, values["B.P_el"])
    recording = Recording(
        time=np.arange(240.0), values=values, segment=np.zeros(240, dtype=int), missing=(), notes=()
    )
    rows = rows_at(opened("abc"), recording)
    system = rows.system
    sets = {frozenset(system.observers[i].id for i in c.observers) for c in rows.cells}
    assert frozenset(o.id for o in system.observers) in sets
    for cell in rows.cells:
        names = {system.observers[i].id for i in cell.observers}
        if names & {"B.pump", "B.power"}:
            assert not np.any(system.data.values["B.n"][cell.points] == 0.0)
    assert any("A.pump" in s and "B.pump" not in s for s in sets)


def test_a_missing_column_leaves_what_can_still_be_compared() -> None:
    """Without a power reading there is one row less, and no estimate that needs it."""
    rules, _ = opened("abc")
    recording = recorded(opened("abc"), tour(rules, SAMPLES))
    rows = rows_at(opened("abc"), without(recording, "A.P_el"))
    assert [4] == [c.rank for c in rows.cells]
    assert "A.power" not in rows.system.number


def test_columns_are_derivatives_of_rows() -> None:
    """The slope of all rows by a parameter, against a finite difference where errors vanish."""
    _, builder = opened("abc")
    rows = rows_at(opened("abc"), quiet("abc"))
    system, known = rows.system, builder.parameters
    flows = system.flows(Configuration(), known.ids)
    maps = rows.maps(flows)
    base = errors(rows)
    for name in ("A.C2", "A.k2", "B.eta", "C.k2"):
        i = known.ids.index(name)
        step = 1e-3 * np.sqrt(known.covariance[i, i])
        moved = Configuration(values={name: float(known.values[i] + step)})
        expected = (rows.errors(system.flows(moved))[0] - base) / step
        found = rows.column(maps, flows.by_value[name])
        size = float(np.abs(expected).max())
        assert expected / size == pytest.approx(found / size, abs=2e-3), name


def test_groups_are_the_rows_of_a_point() -> None:
    """Sums per group add up rows of one point."""
    rules, _ = opened("abc")
    rows = rows_at(opened("abc"), recorded(opened("abc"), tour(rules, SAMPLES)))
    ones = rows.per_group(np.ones(len(rows)))
    assert np.array_equal(rows.group_rank, ones)
    assert np.array_equal(rows.group_point[rows.group], rows.point)
    assert rows.groups == len(ones)
