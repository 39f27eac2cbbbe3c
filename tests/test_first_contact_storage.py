"""A tank between two metered lines: what nobody would believe is not told."""

from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main
from tests.conftest import Capsys
from tests.written import json_of, write_columns, write_plant

METER = """\
module: meter
version: 1
title: Line with a flow meter
signals:
  Q: {quantity: volume flow, unit: m3/h, sensor: magnetic-inductive, range: [0, 20],
      input: true, reference: 6}
observers:
  flow: {component: line, Q: Q, reference: true, source: flow meter}
faults: [slope(Q)]
"""
TANK = """\
module: day-tank
version: 1
title: Day tank with a level transmitter
signals:
  L: {quantity: level, unit: m, sensor: ultrasonic-level, range: [0, 2.5]}
states:
  h: {quantity: level, unit: m, der: (inflow - outflow)/A, start: h0, low: 0, source: balance}
parameters:
  A:  {value: 3.14, unit: m2, u: 0.03, title: cross-section, source: drawing}
  h0: {value: 1, unit: m, u: 0.5, title: level at the beginning, source: "[assumed]"}
readings:
  L: {is: h, source: level transmitter}
faults: [lost-inflow(inflow), unseen-outflow(outflow), slope(L), offset(L)]
"""


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    kinds = {"feed": "meter", "tank": "day-tank", "out": "meter"}
    folder = write_plant(tmp_path / "day", kinds, "feed -> tank, tank -> out")
    modules = folder / "kb" / "modules"
    modules.mkdir(parents=True)
    (modules / "meter.yaml").write_text(METER, encoding="utf-8")
    (modules / "day-tank.yaml").write_text(TANK, encoding="utf-8")
    return folder


def recorded(file: Path, leak: float, seed: int = 6) -> Path:
    """Four hours, a row each second: filled between 0.6 and 1.8 m, drawn from all the time; the
    bottom leaks in the second half, m3/h at 1 m."""
    random = np.random.default_rng(seed)
    time, level, filling = np.arange(14400), 1.0, False
    drawn = np.repeat(random.choice([2.0, 3.0, 5.0, 7.0], 12), 1200)
    fed, levels = np.zeros(len(time)), np.zeros(len(time))
    for i in time.tolist():
        filling = level < 0.6 or (filling and level < 1.8)
        fed[i], levels[i] = 12.0 * filling, level
        lost = leak * np.sqrt(level) * (i >= 7200)
        level += (fed[i] - drawn[i] - lost) / 3600.0 / 3.14
    noise = random.standard_normal((3, len(time)))
    columns = {
        "t [s]": time,
        "feed.Q [m3/h]": fed * (1.0 + 0.004 * noise[0]),
        "tank.L [m]": levels + 0.002 * noise[1],
        "out.Q [m3/h]": drawn * (1.0 + 0.004 * noise[2]),
    }
    return write_columns(file, columns)


def test_a_meter_of_a_pump_that_stands_does_not_explain_a_leak(plant: Path, tmp_path: Path) -> None:
    """An error of its zero, scaled by a slope of nearly 100 %, would be any flow."""
    found = json_of("diagnose", plant, recorded(tmp_path / "leak.csv", 0.5))
    assert not [f for f in found["findings"] if f["degree"] > 0.5]
    assert found["findings"] or found["unknown"]


def test_what_is_unknown_is_told_with_its_size(plant: Path, tmp_path: Path) -> None:
    """No fault of this tank is a leak that does not depend on what is drawn."""
    found = json_of("diagnose", plant, recorded(tmp_path / "leak.csv", 3.0))
    (unknown,) = {period["text"] for period in found["unknown"]}
    assert "m below what the balances predict" in unknown


def test_a_zero_that_the_free_start_takes_up_is_not_called_detectable(
    plant: Path, tmp_path: Path, capsys: Capsys
) -> None:
    """Each window begins at any level, so a level that is 0.3 m off all along leaves no trace."""
    assert 0 == main(["check", str(plant), str(recorded(tmp_path / "sound.csv", 0.0))])
    told = capsys.readouterr().out
    assert "detectable faults: 8 of 10" in told
    assert "undetectable: tank.L.offset.high, tank.L.offset.low" in told


def test_calibrate_sends_a_tank_to_the_command_that_fits_it(
    plant: Path, tmp_path: Path, capsys: Capsys
) -> None:
    """Both meters are there, and no law beside them."""
    recording = recorded(tmp_path / "sound.csv", 0.0)
    assert 1 == main(["calibrate", str(plant), str(recording), "-o", str(tmp_path / "c.yaml")])
    assert "`rulec mismatch` fits the balances of tank" in capsys.readouterr().err


@pytest.fixture
def leaky(plant: Path) -> Path:
    """The same, with a tank whose type knows leaks."""
    file = plant / "kb" / "modules" / "day-tank.yaml"
    file.write_text(TANK.replace("faults: [", "faults: [leak(inflow), stray-inflow(inflow), "))
    return plant


def stood(file: Path, litres: float) -> Path:
    """A day without any flow, a row a minute: so many litres an hour leave the tank."""
    time = np.arange(1440) * 60.0
    level = 1.6 - litres * time / 3.6e6 / 3.14
    noise = 0.002 * np.random.default_rng(5).standard_normal(len(time))
    columns = {"feed.Q [m3/h]": 0.0 * time, "tank.L [m]": level + noise}
    return write_columns(file, {"t [s]": time, **columns, "out.Q [m3/h]": 0.0 * time})


def test_a_tank_that_loses_water_at_standstill_leaks(leaky: Path, tmp_path: Path) -> None:
    """A share of a reading of zero is nothing: errors of the meters explain no 0.3 m in a day."""
    (found,) = json_of("diagnose", leaky, stood(tmp_path / "night.csv", 40.0))["findings"]
    assert ("tank.leak", "l/h") == (found["fault"], found["unit"])
    assert found["lower"] <= 40.0 <= found["upper"] < 60.0
    calm = json_of("diagnose", leaky, stood(tmp_path / "calm.csv", 0.0))
    assert [] == [*calm["findings"], *calm["unknown"]]


def test_a_leak_in_operation_is_told_in_litres_an_hour(leaky: Path, tmp_path: Path) -> None:
    """It falls with the root of the level, from 0.67 to 0.39 m3/h here."""
    (found,) = json_of("diagnose", leaky, recorded(tmp_path / "leak.csv", 0.5))["findings"]
    assert "tank.leak" == found["fault"]
    assert 390.0 < found["degree"] < 670.0
    assert abs(found["since"] - 7200.0) < 300.0


def switched(file: Path, every: int, seed: int, litres: float = 0.0) -> Path:
    """A day, a row every so many seconds: a pump switches by the level, in between. From noon on so
    many litres an hour leak."""
    random, level, filling = np.random.default_rng(seed), 1.2, False
    drawn = np.repeat(random.choice([0.0, 2.0, 3.0, 4.0], 48), 1800)
    fed, levels = np.zeros(86400), np.zeros(86400)
    for i in range(86400):
        filling = level < 0.6 or (filling and level < 1.8)
        fed[i], levels[i] = 12.0 * filling, level
        lost = litres / 1000.0 * (i >= 43200)
        level += (fed[i] - drawn[i] - lost) / 3600.0 / 3.14
    rows = np.arange(0, 86400, every)
    noise = 0.0005 * random.standard_normal(len(rows))
    columns = {"feed.Q [m3/h]": fed[rows], "tank.L [m]": levels[rows] + noise}
    return write_columns(file, {"t [s]": rows, **columns, "out.Q [m3/h]": drawn[rows]})


@pytest.mark.parametrize("every", [20, 60])
def test_a_pump_that_switches_between_two_rows_hides_no_leak(
    leaky: Path, tmp_path: Path, every: int
) -> None:
    """In a minute it moves 0.06 m, which no row shows; that is neither a fault nor a misfit."""
    sound = json_of("diagnose", leaky, switched(tmp_path / "sound.csv", every, 1))
    assert [] == [*sound["findings"], *sound["unknown"]]
    leak = switched(tmp_path / "leak.csv", every, 1, 60.0)
    (found,) = json_of("diagnose", leaky, leak)["findings"]
    assert "tank.leak" == found["fault"]
    assert found["lower"] <= 60.0 <= found["upper"] < 80.0


def boosted(file: Path, litres: float) -> Path:
    """Eight hours of a pressure vessel, a row in ten seconds: its pump switches at 3 and 6 bar, and
    seldom; from the sixth hour on so many litres an hour leak."""
    random, level, running, drawn = np.random.default_rng(1), 1.0, False, 0.0
    rows = []
    for second in range(28800):
        pressure = 5.0 / (2.0 - level) - 1.013
        running = pressure < 3.0 or (running and pressure <= 6.0)
        if second % 900 == 0:
            drawn = float(random.choice([0, 0, 4, 8, 12]))
        if second % 10 == 0:
            true = np.array([18.0 * running, level, pressure, drawn])
            error = np.array([0.036 * running, 0.001, 0.005, 0.002 * drawn])
            rows.append([second, *(true + error * random.standard_normal(4))])
        lost = litres / 60.0 * (second >= 21600)
        level += (18.0 * running - drawn - lost) / 60000.0 / (np.pi / 4.0 * 0.8**2)
    titles = ["t [s]", "feed.Q [l/min]", "W.l [m]", "W.p [bar]", "use.Q [l/min]"]
    return write_columns(file, dict(zip(titles, np.array(rows).T, strict=True)))


def test_a_pump_that_switches_seldom_is_no_fault(tmp_path: Path) -> None:
    """Fewer than half of the windows hold a jump, so the usual misfit does not show it."""
    kinds = {"feed": "metered-pump", "W": "gas-cushion-vessel", "use": "metered-pump"}
    vessel = write_plant(tmp_path / "vessel", kinds, "feed -> W, W -> use")
    sound = json_of("diagnose", vessel, boosted(tmp_path / "sound.csv", 0.0))
    assert [] == [*sound["findings"], *sound["unknown"]]
    (found,) = json_of("diagnose", vessel, boosted(tmp_path / "leak.csv", 60.0))["findings"]
    assert "W.leak" == found["fault"]
    assert found["lower"] <= 60.0 <= found["upper"]
