"""Plants that store: what the compiler says of them, and `rulec simulate`."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.recordings.recording_file import read_file

from rulec.cli import main
from rulec.passes.pipeline import compile_plant
from rulec.simulation.first_readings import starts_of
from tests.conftest import Capsys, compiled
from tests.states.plants import FEED, STORE, TANKS, plant_in, random_inputs, two_tanks, write_inputs
from tests.written import read_columns, write_columns

CHAIN = {"P": "feed", "T": "store"}


def simulated(inputs: Path, target: Path, *options: str, plant: Path = TANKS) -> Path:
    assert 0 == main(["simulate", str(plant), str(inputs), "-o", str(target), *options])
    return target


def chain(folder: Path, **replaced: str) -> Path:
    """A feed and a store: level = 0.5 m + integral of 0.5 mm/s per V."""
    return plant_in(folder, CHAIN, "P -> T", feed=FEED, store=STORE, **replaced)


def test_a_test_record_needs_time_and_input_alone(tmp_path: Path) -> None:
    """Predicted is the sensor that the column map knows, under its foreign name; no other."""
    time, u = random_inputs()
    inputs = write_inputs(tmp_path / "in.csv", time, u)
    made = simulated(inputs, tmp_path / "out.csv")
    assert ["time [s]", "u [V]", "y [V]"] == list(pd.read_csv(made))
    expected = np.clip(two_tanks(time, u), 0.0, 10.0)
    np.testing.assert_allclose(read_columns(made)["y [V]"], expected, rtol=0, atol=1e-5)


def test_sensors_show_the_ends_of_their_range(tmp_path: Path, capsys: Capsys) -> None:
    """Also with sensor errors, and a note says in how many rows."""
    inputs = write_inputs(tmp_path / "in.csv", 4.0 * np.arange(300), np.full(300, 8.0))
    plain = read_columns(simulated(inputs, tmp_path / "a.csv"))["y [V]"]
    assert 10.0 == plain.max()
    assert "lower.y would be above its sensor's range, which then shows 10 V" in (
        capsys.readouterr().err
    )
    noisy = read_columns(simulated(inputs, tmp_path / "b.csv", "--noise", "3"))["y [V]"]
    assert 10.0 == noisy.max()
    inside = plain < 9.0
    assert 1e-3 < np.std((noisy - plain)[inside]) < 0.05
    again = simulated(inputs, tmp_path / "c.csv", "--noise", "3")
    assert (tmp_path / "b.csv").read_bytes() == again.read_bytes()


def test_odd_rows(tmp_path: Path, capsys: Capsys) -> None:
    """Out of order, without a time, without an input, twice at a time, and after a gap."""
    file = tmp_path / "in.csv"
    rows = ["time [s],P.u [V]", "0,", "8,4", "4,2", "12,", ",2", "16,6", "16,0", "116,2", "120,2"]
    file.write_text("\n".join([*rows, ""]))
    made = simulated(file, tmp_path / "out.csv", plant=chain(tmp_path))
    # 0.5 mm for each V and second; the first reading, 2 V, counts from the beginning on.
    expected = 0.5 + 1e-3 * np.array([0.0, 8.0, 4.0, 16.0, np.nan, 24.0, 24.0, 24.0, 28.0])
    np.testing.assert_allclose(read_columns(made)["T.y [m]"], expected, rtol=1e-9)
    output = capsys.readouterr().err
    for note in (
        "2 of 9 rows (the first is data row 1): P.u has no reading; the last one counts on",
        "1 of 9 rows (the first is data row 5) have no usable time; they are not predicted",
        "the rows are not in order of time; they are predicted in it",
        "a gap of 100 s behind data row 7: integrated across",
    ):
        assert f"in.csv: {note}" in output


def test_inputs_may_run_in_lines(tmp_path: Path) -> None:
    """`between: line`: a ramp is a ramp, also across a gap."""
    feed = FEED.replace("input: true", "input: true, between: line")
    plant = plant_in(tmp_path, CHAIN, "P -> T", feed=feed, store=STORE)
    time = np.array([0.0, 4.0, 8.0, 12.0, 16.0, 100.0])
    inputs = write_columns(tmp_path / "in.csv", {"time [s]": time, "P.u [V]": time / 10})
    made = simulated(inputs, tmp_path / "out.csv", plant=plant)
    expected = 0.5 + 0.5e-3 * time**2 / 20
    np.testing.assert_allclose(read_columns(made)["T.y [m]"], expected, rtol=1e-9)
    rules = compile_plant(plant)
    assert ["line", "hold"] == [s.between for s in rules.signals]
    (tmp_path / "rules.json").write_text(rules.to_json())
    assert read_ruleset(tmp_path / "rules.json") == rules


def refused(plant: Path, folder: Path, rows: str, capsys: Capsys) -> str:
    """What is told; nothing is written."""
    source, target = folder / "in.csv", folder / "none.csv"
    source.write_text(rows)
    assert 1 == main(["simulate", str(plant), str(source), "-o", str(target)])
    assert not target.exists()
    return capsys.readouterr().err


PRESSED = """\
module: pressed-store
version: 1
title: Tank emptied by a pump whose pressure follows from the level and the flow
signals:
  n:  {quantity: rotational speed, unit: rpm, sensor: converter-speed, input: true, reference: 900}
  dp: {quantity: pressure difference, unit: bar, sensor: piezoresistive, range: [0, 9],
       reference: 1}
  y:  {quantity: level, unit: m, sensor: tunnel-level, range: [0, 2], reference: 0.5}
states:
  h: {quantity: level, unit: m, der: (inflow - outflow)/A, start: h0, low: 0, source: balance}
parameters:
  A:  {value: 2, unit: m2, u: 0.1, title: cross-section, source: made up}
  h0: {value: 0.5, unit: m, u: 0.1, title: level at the beginning, source: made up}
  V:  {value: 10, unit: ml/rev, u: 0.02, title: displacement, source: made up}
  b:  {value: 0.1, unit: bar/m, u: 0.001, title: pressure by level, source: made up}
  k:  {value: 100, unit: l/h/bar, u: 1, title: flow by pressure, source: made up}
definitions:
  outflow: {is: n*V}
observers:
  pump: {component: pump, Q: n*V, source: made up}
  line: {component: line, Q: k*(dp - b*y), source: made up}
residuals: [pump-line]
readings:
  y: {is: h, source: made up}
"""


def test_balances_and_what_follows_at_once(tmp_path: Path, capsys: Capsys) -> None:
    """A pressure over a level: the predicted level counts, not the recorded one. A balance that
    feeds on itself, and a flow by a pressure that follows from the level, are told."""
    plant = plant_in(tmp_path, {"T": "pressed-store"}, pressed=PRESSED)
    (tmp_path / "in.csv").write_text("time [s],T.n [rpm],T.y [m]\n0,900,9\n60,900,9\n120,900,9\n")
    made = simulated(tmp_path / "in.csv", tmp_path / "out.csv", plant=plant)
    flow = 15.0 * 10e-6
    level = 0.5 - flow * np.array([0.0, 60.0, 120.0]) / 2.0
    np.testing.assert_allclose(read_columns(made)["T.y [m]"], level, rtol=1e-9)
    dp = 0.1 * level + flow * 3.6e6 / 100
    np.testing.assert_allclose(read_columns(made)["T.dp [bar]"], dp, rtol=1e-6)
    store = STORE.replace("inflow/A", "inflow/A + r*h").replace(", high: top", "")
    store = store.replace("top: {value: 10, unit: m,", "r:   {value: 2, unit: 1/s,")
    plant = plant_in(tmp_path / "a", CHAIN, "P -> T", feed=FEED, store=store)
    output = refused(plant, tmp_path, "time [s],P.u [V]\n0,1\n100,1\n200,1\n300,1\n", capsys)
    assert "a state of made-up grows beyond all bounds" in output
    circle = PRESSED.replace("outflow: {is: n*V}", "outflow: {is: k*(dp - b*y)}")
    plant = plant_in(tmp_path / "b", {"T": "pressed-store"}, pressed=circle)
    output = refused(plant, tmp_path, "time [s],T.n [rpm]\n0,900\n60,900\n", capsys)
    assert "its balances need T.dp, which follows from T.y" in output


def stored(folder: Path, level: float) -> tuple[Path, Path]:
    """A feed and a store that is filled to a level, cm, when it begins; a minute of a steady
    signal to the feed."""
    store = STORE.replace("value: 50", f"value: {level}")
    inputs = folder / "in.csv"
    inputs.write_text("time [s],P.u [V]\n" + "".join(f"{t},2\n" for t in range(60)))
    return plant_in(folder / str(level), CHAIN, "P -> T", feed=FEED, store=store), inputs


def test_a_noisy_start_lies_within_its_uncertainty(tmp_path: Path) -> None:
    """A store that begins at 80 cm instead of the stated 50, ten draws of the sensor's errors: what
    is told of the first readings is not too sure."""
    fuller, inputs = stored(tmp_path, 80)
    ruleset = compile_plant(fuller)
    far = []
    for seed in range(10):
        options = ("--noise", str(seed))
        seen = simulated(inputs, tmp_path / f"{seed}.csv", *options, plant=fuller)
        found = starts_of(ruleset, read_file(seen, ruleset, []))
        value, u = (float(text) for text in re.findall(r"at (\S+) ± (\S+)", found.notes[0])[0])
        assert abs(found.values["T.h0"] - 0.01 * value) < 1e-3
        far.append((value - 80.0) / u)
    assert np.max(np.abs(far)) < 3.0
    assert 0.3 < np.sqrt(np.mean(np.square(far))) < 2.0


COLUMNS = "columns:\n  time: {from: t, unit: s}\n  pump.u: {from: u, unit: V}\n"


@pytest.mark.parametrize(
    ("mapped", "expected"),
    [("lower.y", ()), ("upper.y", ("lower",)), ("", ("pump", "upper", "lower"))],
)
def test_only_sensors_that_are_there_see(
    tmp_path: Path, mapped: str, expected: tuple[str, ...]
) -> None:
    """A column map says which ones are; what lies below the last one is not seen."""
    assert () == compiled("cascaded-tanks").unobserved
    text = (TANKS / "plant.yaml").read_text(encoding="utf-8")
    (tmp_path / "plant.yaml").write_text(text, encoding="utf-8")
    column = f"  {mapped}: {{from: y, unit: V}}\n" if mapped else ""
    (tmp_path / "columns.yaml").write_text(COLUMNS + column, encoding="utf-8")
    assert expected == compile_plant(tmp_path).unobserved


def test_a_plant_of_stores_alone(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    """No observer at all: nothing is compared at rest, but levels are predicted."""
    plant = plant_in(tmp_path, {"T": "store"}, store=STORE)
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
    dynamics = compile_plant(plant_in(tmp_path, CHAIN, "P -> T", feed=feed, store=store)).dynamics
    assert dynamics is not None
    assert ("P.u",) == dynamics.inputs
