"""A characteristic learnt from operation: near the truth, with a band that says so, or refused."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import rulec
from rulec.calibration.fit import CalibrationRefused
from rulec.cli import main
from rulec.commands.check_files import collect
from tests.conftest import ROOT
from tests.rig import real
from tests.written import json_of, write_columns, write_plant

TYPE = """\
module: own-valve
version: 1
title: Valve
signals:
  x:  {quantity: valve travel, unit: "%", sensor: positioner, range: [0, 100], input: true, reference: 60}
  dp: {quantity: pressure difference, unit: bar, sensor: piezoresistive, range: [0, 4], input: true, reference: 2}
  Q:  {quantity: volume flow, unit: m3/h, sensor: magnetic-inductive, range: [0, 20], reference: 3}
parameters:
  Kvs: {value: 4, unit: m3/h/bar**0.5, u: 1, source: data sheet}
  p0:  {value: 0, unit: bar, u: 0.001, sign: any, source: "[assumed]"}
definitions:
  Kv:  {is: Kvs*x, accuracy: "10 %, IEC 60534-2-4", title: flow coefficient at this travel}
  Q_v: {is: Kv*sqrt(dp - p0), title: flow through the valve}
observers:
  valve: {component: valve, Q: Q_v, source: IEC 60534-2-1}
  flow:  {component: line, Q: Q, reference: true, source: flow meter}
faults: [seat-deposit(Kv), slope(Q)]
"""  # noqa: E501


def kv(x: Any) -> Any:
    """The truth: equal percentage, 4 m3/h/bar**0.5 fully open, a rangeability of 30."""
    return 4.0 * 30.0 ** (np.asarray(x) / 100.0 - 1.0)


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    (tmp_path / "kb").mkdir()
    (tmp_path / "kb" / "own-valve.yaml").write_text(TYPE, encoding="utf-8")
    return write_plant(tmp_path, {"M": "own-valve"})


def operation(travels: Any, seed: int = 1, noise: float = 0.005) -> dict[str, Any]:
    """Readings of a day: each travel is held for 20 s, at pressures that vary."""
    random = np.random.default_rng(seed)
    x = np.repeat(np.asarray(travels, dtype=float), 20)
    dp = np.repeat(random.uniform(0.8, 3.0, len(travels)), 20)
    flow = kv(x) * np.sqrt(dp)
    return {
        "time [s]": np.arange(len(x), dtype=float),
        "M.x [%]": x,
        "M.dp [bar]": dp + random.normal(0, 0.002, len(x)),
        "M.Q [m3/h]": flow * (1 + noise * random.normal(0, 1, len(x))),
    }


TRAVELS = np.random.default_rng(5).uniform(20, 95, 80)


def test_a_valve_that_is_not_linear(plant: Path) -> None:
    """Between its knots an exponential is a little below straight lines: 6 % at most with eight.
    Points far off are set aside."""
    day = operation(TRAVELS)
    data = rulec.learn(plant, day, "M.Kv").to_dict()
    assert (data["over"], data["in"], data["unit"]) == ("x", "%", "m3/h/bar**0.5")
    at, value, u = points_of(data)
    assert np.all(np.diff(value) >= 0)
    grid = np.linspace(at[0], at[-1], 50)
    assert value == pytest.approx(kv(at), rel=0.08)
    assert np.interp(grid, at, value) == pytest.approx(kv(grid), rel=0.08)
    assert np.all(u > 0)
    assert np.mean(np.abs(value - kv(at)) < 3 * u) > 0.7
    day["M.Q [m3/h]"][400:440] *= 3.0
    data = rulec.learn(plant, day, "M.Kv").to_dict()
    assert data["set_aside"] >= 2
    at, value, _ = points_of(data)
    assert value == pytest.approx(kv(at), rel=0.1)


def points_of(data: dict[str, Any]) -> Iterator[Any]:
    """Places, values and uncertainties of a curve, each of shape (points,)."""
    return (np.array([p[key] for p in data["points"]]) for key in ("at", "value", "u"))


def test_what_was_learnt_is_knowledge(plant: Path) -> None:
    """The type compiles and calibrates; then nothing is found in new data, but half a flow is."""
    usual = operation(TRAVELS)
    found = rulec.learn(plant, usual, "M.Kv")
    found.write(plant / "kb" / "learnt.yaml")
    write_plant(plant, {"M": "learnt"})
    assert [] == [one for one in collect([plant]) if not one.doubt]
    data = yaml.safe_load((plant / "kb" / "learnt.yaml").read_text(encoding="utf-8"))
    assert "Kvs" not in data["parameters"]
    assert "Kv" not in data["definitions"]
    rulec.calibrate(plant, usual).write(plant / "calibration.yaml")
    write_plant(plant, {"M": "learnt"}, calibration="[calibration.yaml]")
    day = operation(np.repeat(TRAVELS[:12], 3), seed=9)
    assert [] == list(rulec.diagnose(plant, day).findings)
    blocked = {**day, "M.Q [m3/h]": 0.5 * day["M.Q [m3/h]"]}
    finding = rulec.diagnose(plant, blocked).findings[0]
    assert finding.fault.id in {"M.seat-deposit", "M.Q.low"}


def test_a_day_of_a_real_boiler() -> None:
    """Its branch passes a fifth of what the sheet says; the fit goes there, and leaves out a point
    of 75."""
    day = real("rse-district-heating") / "0412_Test1.csv.gz"
    data = rulec.learn(ROOT / "plants" / "rse-boiler", day, "boiler.opening").to_dict()
    at, value, u = points_of(data)
    assert (75.0, 100.0) == (at[0], at[-1])
    assert value[0] + 2.0 * u[0] < 10.0
    assert (74, 1) == (data["settled"], data["set_aside"])
    assert data["accuracy"] < 0.1


def test_the_command_writes_the_type(plant: Path, capsys: Any) -> None:
    day = operation(TRAVELS)
    file = write_columns(plant / "day.csv", day)
    target = plant / "kb" / "learnt.yaml"
    asked = ["calibrate", str(plant), str(file), "--learn", "M.Kv", "-o", str(target)]
    assert json_of(*asked)["dropped"] == ["Kvs"]
    output = " ".join(capsys.readouterr().out.split())
    assert "no data from 0 to 2" in output
    assert "give M the type learnt" in output
    assert [] == [one for one in collect([target]) if not one.doubt]
    assert 2 == main([*asked[:3], "-o", str(target), "--over", "x"])


@pytest.mark.parametrize(
    ("what", "over", "said"),
    [
        ("N.Kv", None, "there is no module 'N'"),
        ("M", None, "has no definition ''"),
        ("M.Q_v", None, "name what it follows with --over"),
        ("M.Q_v", "x", "follows dp, too"),
        ("M.Kv", "y", "has no such signal"),
    ],
)
def test_what_cannot_be_learnt(what: str, over: str | None, said: str, plant: Path) -> None:
    with pytest.raises(CalibrationRefused, match=said):
        rulec.learn(plant, operation(TRAVELS), what, over=over)


def test_recordings_that_tell_nothing(plant: Path) -> None:
    for noise in (0.0, 0.1):
        travels = 50.0 + noise * np.random.default_rng(7).standard_normal(80)
        with pytest.raises(CalibrationRefused, match="x stood, as far as its sensor can tell"):
            rulec.learn(plant, operation(travels), "M.Kv")
    with pytest.raises(CalibrationRefused, match="are needed for a curve"):
        rulec.learn(plant, operation(TRAVELS[:3]), "M.Kv")
    lacking = {k: v for k, v in operation(TRAVELS).items() if k != "M.dp [bar]"}
    with pytest.raises(CalibrationRefused, match="lacks dp"):
        rulec.learn(plant, lacking, "M.Kv")
    shut = {**operation(TRAVELS), "M.Q [m3/h]": np.zeros(20 * len(TRAVELS))}
    with pytest.raises(CalibrationRefused, match="nothing flows through M"):
        rulec.learn(plant, shut, "M.Kv")
    with pytest.raises(CalibrationRefused, match="that is not zero throughout"):
        rulec.calibrate(plant, shut)


ALIKE = """\
module: own-line
version: 1
title: Line
signals:
  x: {quantity: valve travel, unit: "%", sensor: positioner, range: [0, 100], input: true, reference: 50}
  Q: {quantity: volume flow, unit: m3/h, sensor: magnetic-inductive, range: [0, 20], reference: 8.25}
parameters:
  a: {value: 3, unit: m3/h, u: 0, sign: any, source: made up}
  b: {value: 10, unit: m3/h, u: 0, sign: any, source: made up}
  c: {value: 1, unit: m3/h, u: 0, sign: any, source: made up}
observers:
  law:  {component: line, Q: a + b*x + c*x**2, source: made up}
  flow: {component: line, Q: Q, reference: true, source: flow meter}
faults: [slope(Q)]
"""  # noqa: E501


def test_a_covariance_keeps_its_digits(tmp_path: Path) -> None:
    """Where the travel hardly varies, its three parameters are known together alone; a plant reads
    the file all the same."""
    (tmp_path / "kb").mkdir()
    (tmp_path / "kb" / "own-line.yaml").write_text(ALIKE, encoding="utf-8")
    plant = write_plant(tmp_path, {"M": "own-line"})
    day = operation(50.0 + 0.04 * np.linspace(-1, 1, 40))
    share = day["M.x [%]"] / 100
    noise = 1 + 1e-3 * np.random.default_rng(1).standard_normal(len(share))
    day["M.Q [m3/h]"] = (3 + 10 * share + share**2) * noise
    rulec.calibrate(plant, day).write(plant / "calibration.yaml")
    write_plant(plant, {"M": "own-line"}, calibration="[calibration.yaml]")
    assert [] == [one for one in collect([plant]) if not one.doubt]


def test_a_module_with_nothing_to_fit(plant: Path) -> None:
    """Its misfit and ranges are calibrated all the same, and the file compiles."""
    kind = plant / "kb" / "own-valve.yaml"
    kind.write_text(TYPE.replace("u: 1,", "u: 1, fit: false,").replace("0.001,", "0, fit: false,"))
    rulec.calibrate(plant, operation(TRAVELS)).write(plant / "calibration.yaml")
    write_plant(plant, {"M": "own-valve"}, calibration="[calibration.yaml]")
    assert [] == [one for one in collect([plant]) if not one.doubt]
