"""What the compiler says of plants that store."""

from __future__ import annotations

from pathlib import Path

import pytest

from rulec.cli import main
from rulec.passes.pipeline import compile_plant
from tests.conftest import compiled
from tests.states.plants import FEED, STORE, TANKS, plant_in

COLUMNS = "columns:\n  time: {from: t, unit: s}\n  pump.u: {from: u, unit: V}\n"


def test_what_a_level_sees_is_observed() -> None:
    """A pump that fills a tank that fills a tank with a sensor leaves its trace."""
    assert () == compiled("cascaded-tanks").unobserved


@pytest.mark.parametrize(
    ("mapped", "expected"),
    [("lower.y", ()), ("upper.y", ("lower",)), ("", ("pump", "upper", "lower"))],
)
def test_only_sensors_that_are_there_see(
    tmp_path: Path, mapped: str, expected: tuple[str, ...]
) -> None:
    """A column map says which ones are; what lies below the last one is not seen."""
    text = (TANKS / "plant.yaml").read_text(encoding="utf-8")
    (tmp_path / "plant.yaml").write_text(text, encoding="utf-8")
    column = f"  {mapped}: {{from: y, unit: V}}\n" if mapped else ""
    (tmp_path / "columns.yaml").write_text(COLUMNS + column, encoding="utf-8")
    assert expected == compile_plant(tmp_path).unobserved


def test_balances_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """In words of the author, with limits in the unit of the state, and flows of others."""
    assert 0 == main(["show", "balances", str(TANKS)])
    shown = capsys.readouterr().out.splitlines()
    assert [
        "given: pump.u",
        "pump.pump = k*u   (a flow)",
        "d upper.h/dt = (inflow - outflow)/A   (from h0, not below 0 cm)",
        "upper.inflow = pump.pump",
        "upper.outflow = a*sqrt(2*gravity*h)",
        "upper.y shows g*h + y0",
    ] == shown[:6]
    assert "lower.inflow = upper.outflow" in shown


def test_a_plant_that_stores_nothing_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    """The pass is there for every plant."""
    assert 0 == main(["show", "put_balances", str(TANKS.parent / "abc")])
    assert "nothing is stored\n" == capsys.readouterr().out


def test_a_plant_of_stores_alone(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    """No observer at all: nothing is compared at rest, but levels are predicted."""
    plant = plant_in(tmp_path, "  T: {type: store}\n", store=STORE)
    rules = compile_plant(plant)
    assert [] == list(recwarn)
    assert rules.dynamics is not None
    assert ((), ("T.y",)) == (rules.dynamics.inputs, rules.dynamics.outputs)
    (tmp_path / "in.csv").write_text("time [s],run\n0,7\n5,7\n")
    assert 0 == main(["simulate", str(plant), str(tmp_path / "in.csv"), "-o", str(tmp_path / "o")])
    assert "time [s],run,T.y [m]\n0,7,0.5\n5,7,0.5\n" == (tmp_path / "o").read_text()


def test_a_reading_is_read_as_its_sensor_shows_it(tmp_path: Path) -> None:
    """A feed by the level of the store that it fills: the level is no input of the balances."""
    feed = FEED.replace("Q: k*u", "Q: k*(u - u_h*downstream(l_store))")
    feed = feed.replace("observers:", "  u_h: {value: 1, unit: V/m, u: 0, source: x}\nobservers:")
    store = STORE.replace("der: inflow/A", "der: (inflow - r*y*A)/A")
    store = store.replace("readings:", "  r: {value: 0.01, unit: 1/s, u: 0, source: x}\nreadings:")
    modules = "  P: {type: feed}\n  T: {type: store}\n"
    dynamics = compile_plant(plant_in(tmp_path, modules, "P -> T", feed=feed, store=store)).dynamics
    assert dynamics is not None
    assert ("P.u",) == dynamics.inputs
