"""A plant engineer describes a plant of shipped types as its sheets and its tags have it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rulec_runtime.recordings.recording import read_recording

from rulec.cli import main
from rulec.passes.pipeline import compile_plant
from tests.written import json_of, read_columns, write_columns, write_plant

PSI = 6894.757293168
"""Pa."""

DIFFERENCE = "pump.dp: {{from: PI-102, unit: psi, minus: {{from: PI-101, unit: mbar}}}}"
MAP = "columns:\n  {}\n  " + DIFFERENCE + "\n"
TIME = 'time: {from: "t [s]", unit: s}'


def signal_of(folder: Path, name: str = "pump.dp") -> Any:
    return compile_plant(folder).signal_by_id[name]


@pytest.fixture
def plant(tmp_path: Path) -> Path:
    """A pump with a gauge before and one behind it."""
    folder = write_plant(
        tmp_path / "plant", {"pump": "metered-centrifugal"}, columns="columns.yaml"
    )
    (folder / "columns.yaml").write_text(MAP.format(TIME), encoding="utf-8")
    return folder


@pytest.fixture
def recorded(tmp_path: Path) -> dict[str, Any]:
    """Columns of a healthy recording of the type itself, with the difference as one."""
    own = write_plant(tmp_path / "own", {"pump": "metered-centrifugal"})
    speed, flow = np.repeat((2650.0, 2500.0), 30), np.repeat((700.0, 600.0), 30)
    given = {"t [s]": np.arange(60), "pump.n [rpm]": speed, "pump.Q [l/h]": flow}
    inputs, file = write_columns(tmp_path / "inputs.csv", given), tmp_path / "one.csv"
    assert main(["simulate", str(own), str(inputs), "-o", str(file), "--noise", "1"]) == 0
    return read_columns(file)


def two_gauges(recorded: dict[str, Any], *without: str) -> dict[str, Any]:
    """The same with the pressures before and behind the pump instead of their difference."""
    found = dict(recorded)
    dp, before = found.pop("pump.dp [bar]"), 0.3 + 0.1 * np.sin(np.arange(60) / 9)
    found |= {"PI-101": 1000 * before, "PI-102": (dp + before) * 1e5 / PSI}
    return {title: column for title, column in found.items() if title not in without}


def test_a_plant_states_its_own_transmitter(tmp_path: Path) -> None:
    """Range and class of one instance; other instances, and what is not stated, remain."""
    stated = "metered-centrifugal, signals: {dp: {range: [0, 300], unit: psi}}"
    folder = write_plant(tmp_path / "plant", {"pump": stated, "other": "metered-centrifugal"})
    pump, other = (signal_of(folder, f"{name}.dp") for name in ("pump", "other"))
    assert pump.full_scale == pump.highest == pytest.approx(300 * PSI)
    assert pump.standard == other.standard
    assert other.highest < pump.highest
    stated = "metered-centrifugal, signals: {dp: {sensor: process-pressure}}"
    folder = write_plant(tmp_path / "plant", {"pump": stated})
    worse = signal_of(folder)
    assert worse.highest == other.highest
    assert worse.standard == pytest.approx(5 * other.standard)
    stated = "metered-centrifugal, signals: {dp: {minimum: 2, unit: psi}}"
    less = signal_of(write_plant(tmp_path / "plant", {"pump": stated}))
    assert (less.minimum, less.highest) == (pytest.approx(2 * PSI), other.highest)


def test_a_wrong_transmitter_is_refused_at_its_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for stated, codes in (
        ("dp: {range: [16, 0], sensor: resistance-thermometer}, p: {range: [0, 1]}", "055 033 071"),
        ("dp: {snsor: process-pressure}", "020"),
        ("dp: {unit: psi, sensor: process-pressure}", "021"),
    ):
        folder = write_plant(tmp_path, {"pump": f"metered-centrifugal, signals: {{{stated}}}"})
        assert main(["check", str(folder)]) == 1
        text = capsys.readouterr().out
        assert [code for code in codes.split() if f"KB{code} " not in text] == []


def test_a_column_may_be_the_difference_of_two_gauges(
    plant: Path, tmp_path: Path, recorded: dict[str, Any]
) -> None:
    one = write_columns(tmp_path / "one.csv", recorded)
    two = write_columns(tmp_path / "two.csv", two_gauges(recorded))
    told = json_of("diagnose", plant, two)
    assert told["status"] == json_of("diagnose", plant, one)["status"] == "ok"
    assert told["judged"] >= 58
    # Two gauges are as uncertain as two gauges.
    single = signal_of(write_plant(tmp_path / "single", {"pump": "metered-centrifugal"}))
    assert signal_of(plant).standard == pytest.approx(2**0.5 * single.standard)


def test_one_gauge_of_two_is_no_reading(
    plant: Path, tmp_path: Path, recorded: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    file = write_columns(tmp_path / "two.csv", two_gauges(recorded, "PI-101"))
    assert main(["diagnose", str(plant), str(file)]) == 3
    text = " ".join(capsys.readouterr().out.split())
    assert "pump.dp has no reading: 'PI-101' is missing beside 'PI-102'" in text


def test_a_prediction_leaves_the_two_gauges_as_they_are(
    plant: Path, tmp_path: Path, recorded: dict[str, Any]
) -> None:
    file, out = write_columns(tmp_path / "two.csv", two_gauges(recorded)), tmp_path / "out.csv"
    assert main(["simulate", str(plant), str(file), "-o", str(out)]) == 0
    before, after = read_columns(file), read_columns(out)
    assert after["PI-102"] == pytest.approx(before["PI-102"])
    assert after["pump.dp [bar]"] == pytest.approx(recorded["pump.dp [bar]"], rel=0.02)
    assert json_of("diagnose", plant, out)["status"] == "ok"


def test_a_proposed_map_keeps_what_the_plant_says(
    plant: Path, tmp_path: Path, recorded: dict[str, Any]
) -> None:
    """A difference, a scale, a zone: no file shows them."""
    file, new = write_columns(tmp_path / "two.csv", two_gauges(recorded)), tmp_path / "new.yaml"
    time = 'time: {from: "t [s]", unit: s, zone: Europe/Berlin}'
    (plant / "columns.yaml").write_text(
        MAP.format(time) + '  pump.Q: {from: "pump.Q [l/h]", unit: l/h, scale: 2}\n',
        encoding="utf-8",
    )
    assert main(["check", str(plant), str(file), "--write-map", str(new)]) == 0
    stated, proposed = (
        yaml.safe_load(f.read_text(encoding="utf-8"))["columns"]
        for f in (plant / "columns.yaml", new)
    )
    assert stated.items() <= proposed.items()
    assert proposed["pump.n"] == {"from": "pump.n [rpm]", "unit": "rpm"}


def test_a_map_may_be_written_to_the_file_that_the_plant_already_names(
    plant: Path, tmp_path: Path, recorded: dict[str, Any]
) -> None:
    file, map_ = write_columns(tmp_path / "one.csv", recorded), plant / "columns.yaml"
    map_.unlink()
    assert main(["check", str(plant), str(file), "--write-map", str(map_)]) == 0
    assert main(["check", str(plant), str(file)]) == 0


SCREW = """
module: screw
version: 1
title: Screw pump
signals:
  n:  {quantity: rotational speed, unit: rpm, sensor: converter-speed, input: true, reference: 1450}
  dp: {quantity: pressure difference, unit: bar, sensor: piezoresistive, range: [0, 16],
       input: true, reference: 6}
  T:  {quantity: temperature, unit: degC, sensor: resistance-thermometer, input: true,
       reference: 40}
  Q:  {quantity: volume flow, unit: l/min, sensor: small-flow-meter, range: [0, 200],
       reference: 100}
parameters:
  V:  {value: 75, unit: ml/rev, u: 1, source: sheet}
  C:  {value: 1, unit: l/min/bar, u: 0.1, source: sheet}
  mu: {value: 40, unit: mPas, u: 0, fit: false, source: sheet}
observers:
  pump: {component: pump, Q: n*V - C*dp*mu/viscosity(T), accuracy: "5 %, sheet", source: sheet}
  flow: {component: pump, Q: Q, reference: true, source: meter}
"""


@pytest.mark.parametrize(
    ("written", "wrong", "told"),
    [
        ("mu/viscosity(T)", "mu/(viscosity(T) - viscosity(T))", ["KB041"]),
        ("75, unit: ml/rev", "75, unit: l/rev", ["KB088", "is 'l/rev' the right unit?"]),
        ("1, unit: l/min/bar", "100, unit: l/min/bar", ["backwards"]),
        ("75", "75", ["no mistakes\n"]),
    ],
)
def test_a_type_that_asks_for_viscosity_is_checked_with_the_fluid_of_the_plant(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], written: str, wrong: str, told: list[str]
) -> None:
    """What compile refuses check reports, with what may explain it."""
    folder = write_plant(tmp_path, {"pump": "screw"}, fluid="hydraulic-oil-46")
    (folder / "kb" / "modules").mkdir(parents=True)
    text = SCREW.replace(written, wrong)
    (folder / "kb" / "modules" / "screw.yaml").write_text(text, encoding="utf-8")
    main(["check", str(folder)])
    shown = " ".join(capsys.readouterr().out.split()) + "\n"
    assert [part in shown for part in told] == [True] * len(told)


@pytest.mark.parametrize(
    ("quantity", "unit", "hint"),
    [
        ("level", "in", "did you mean 'inch'?"),
        ("level", "lbs", "the spellings are in"),
        ("pressure difference", "psid", "did you mean 'psi'?"),
        ("pressure difference", "inH2O", ""),
    ],
)
def test_only_units_of_the_quantity_are_proposed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], quantity: str, unit: str, hint: str
) -> None:
    """Not minutes for a level in inches."""
    text = f"module: own\nversion: 1\ntitle: T\nsignals:\n  a: {{quantity: {quantity}, "
    text += f"unit: {unit}, sensor: level-transmitter, range: [0, 1]}}\n"
    text += "  Q: {quantity: volume flow, unit: gpm, sensor: magnetic-inductive}\n"
    text += "observers: {flow: {component: line, Q: Q, reference: true, source: meter}}\n"
    (tmp_path / "own.yaml").write_text(text, encoding="utf-8")
    main(["check", str(tmp_path)])
    shown = " ".join(capsys.readouterr().out.split())
    assert (hint or "no mistakes") in shown
    assert ("KB050" in shown) == bool(hint)


def test_a_bare_number_is_answered_with_what_belongs_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = "parameters: {h0: 1.2}, reference: {Q: 3 gpm}"
    folder = write_plant(tmp_path, {"pump": f"metered-centrifugal, {more}"})
    assert main(["check", str(folder)]) == 1
    shown = capsys.readouterr().out
    assert "write {value: 1.2, unit: ..., u: ..., source: ...}" in shown
    assert "the number alone, in the unit of the signal" in shown


@pytest.mark.parametrize(
    ("written", "wrong", "told"),
    [
        ("u: 0.1", "u: 5 %", "no percentage, but a number in the unit of this entry"),
        ('accuracy: "5 %, sheet"', "accuracy: 5", "as in '5 %, ISO 9906:2012 grade 2B'"),
    ],
)
def test_a_share_in_the_wrong_form_is_answered_with_the_right_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], written: str, wrong: str, told: str
) -> None:
    (tmp_path / "screw.yaml").write_text(SCREW.replace(written, wrong), encoding="utf-8")
    assert main(["check", str(tmp_path)]) == 1
    assert told in capsys.readouterr().out


def test_the_unit_of_two_columns_is_not_doubted_as_that_of_one(
    plant: Path, tmp_path: Path, recorded: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    """A difference has no header that could be wrong."""
    wrong = {**recorded, "pump.dp [bar]": 0.1 * recorded["pump.dp [bar]"]}
    main(["check", str(plant), str(write_columns(tmp_path / "two.csv", two_gauges(wrong)))])
    assert "factor of 10" not in " ".join(capsys.readouterr().out.split())


def test_errors_of_a_meter_that_is_not_there_are_not_missed(tmp_path: Path) -> None:
    """One meter, two modules of its flow: the valve has none of its own."""
    own = "parameters: {Kv: {value: 2, unit: m3/h, u: 0.1, source: sheet}}, reference: {Q: 0.7}"
    modules = {"pump": "metered-centrifugal", "valve": f"equal-percentage-valve, {own}"}
    folder = write_plant(tmp_path / "line", modules, "pump -> valve")
    random, there = np.random.default_rng(1), compile_plant(folder).signals
    mapped = [f"  {s.id}: {{from: {s.id}, unit: '{s.unit}'}}" for s in there if s.id != "valve.Q"]
    (folder / "columns.yaml").write_text("\n".join(["columns:", *mapped]), encoding="utf-8")
    write_plant(folder, modules, "pump -> valve", columns="columns.yaml")
    rows = {
        f"{s.id} [{s.unit}]": s.shown(s.reference) * (1.0 + 1e-3 * random.standard_normal(60))
        for s in there
        if s.id != "valve.Q"
    }
    file = write_columns(tmp_path / "run.csv", {"t [s]": np.arange(60), **rows})
    told = json_of("diagnose", folder, file)
    assert told["judged"] > 50
    assert (told["status"], told["not_judged"], told["blind"]) == ("ok", [], [])


@pytest.mark.parametrize("layout", ["wide", "quality", "long"])
def test_a_column_of_two_signals_is_converted_once_for_each(tmp_path: Path, layout: str) -> None:
    """In each layout; a thermometer in degF of two modules showed 855 K."""
    modules = {"pump": "metered-centrifugal", "other": "metered-centrifugal"}
    folder = write_plant(tmp_path / "plant", modules, columns="columns.yaml")
    both = "".join(f"  {name}.T: {{from: TI, unit: degF}}\n" for name in modules)
    more = "  pump.Q: {from: FI, unit: gpm}\n"
    (folder / "columns.yaml").write_text(f"columns:\n{both}{more}", encoding="utf-8")
    lines = {
        "wide": ["time [s],TI,FI", *(f"{i},{60 + i},3" for i in range(9))],
        "quality": ["time [s],TI,TI Quality,FI", *(f"{i},{60 + i},Good,3" for i in range(9))],
        "long": ["tag,time,value", *(f"TI,{i},{60 + i}\nFI,{i},3" for i in range(9))],
    }
    file = tmp_path / "run.csv"
    file.write_text("\n".join(lines[layout]) + "\n", encoding="utf-8")
    values = read_recording(file, compile_plant(folder)).values
    kelvin = (60 + np.arange(9) + 459.67) * 5 / 9
    for name in modules:
        assert values[f"{name}.T"] == pytest.approx(kelvin)
