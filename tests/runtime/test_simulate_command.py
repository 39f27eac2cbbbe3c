"""`rulec simulate`: predicted recordings as files, against the independent truth and real ones."""

import csv
import gzip
import shutil
from pathlib import Path

import numpy as np
import pytest

from rulec.cli import main
from tests.conftest import ROOT, Capsys, compiled, recordings_folder
from tests.rig.zema import read_cycles, write_cycles
from tests.states.plants import plant_in
from tests.written import read_columns

ABC = ROOT / "plants" / "abc"
HEALTHY = ABC / "examples" / "healthy.csv"
PREDICTED = ["A.dp [bar]", "A.P_el [W]", "B.dp [bar]", "B.P_el [W]", "C.dp [bar]"]


def table(path: Path) -> list[list[str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.reader(file, delimiter=";" if "semicolon" in path.name else ","))


def simulated(inputs: Path, target: Path, *options: str, plant: Path = ABC) -> Path:
    assert 0 == main(["simulate", str(plant), str(inputs), "-o", str(target), *options])
    return target


def test_columns_keep_name_order_and_unit(tmp_path: Path) -> None:
    """All else stands as it was written, to the letter."""
    before = table(HEALTHY)
    after = table(simulated(HEALTHY, tmp_path / "out.csv"))
    assert (before[0], len(before)) == (after[0], len(after))
    for i, title in enumerate(before[0]):
        same = [row[i] for row in before] == [row[i] for row in after]
        assert same == (title not in PREDICTED), title
    sevens = [["7" if t in PREDICTED else c for t, c in zip(*pair, strict=True)]
              for pair in ((before[0], row) for row in before[1:])]  # fmt: skip
    with (tmp_path / "other.csv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([before[0], *sevens])
    assert after == table(simulated(tmp_path / "other.csv", tmp_path / "b.csv"))
    (tmp_path / "in.csv").write_text("time [s],A.n [1/s],B.n [rpm],cycle\n0,15,900,x\n")
    header, row = table(simulated(tmp_path / "in.csv", tmp_path / "out.csv"))
    assert ["time [s]", "A.n [1/s]", "B.n [rpm]", "cycle", *PREDICTED] == header
    assert ["0", "15", "900", "x"] == row[:4]
    reference = [compiled("abc").signal_by_id[t.split()[0]] for t in PREDICTED]
    assert [s.reference / s.factor for s in reference] == pytest.approx([*map(float, row[4:])])


def test_decimal_commas_stay(tmp_path: Path) -> None:
    (tmp_path / "semicolon.csv").write_text(
        "time [s];A.n [rpm];B.n [rpm];A.dp [bar]\n0,5;900,5;899,5;1\n"
    )
    _, row = table(simulated(tmp_path / "semicolon.csv", tmp_path / "semicolon.out.csv"))
    assert ["0,5", "900,5", "899,5"] == row[:3]
    assert 1.8 == pytest.approx(float(row[3].replace(",", ".")), rel=0.05)
    assert all("." not in cell for cell in row)


def test_a_folder_becomes_a_folder(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    shutil.copy(HEALTHY, tmp_path / "in" / "a.csv")
    (tmp_path / "in" / "b.csv.gz").write_bytes(gzip.compress(HEALTHY.read_bytes()))
    out, again, other = (
        simulated(tmp_path / "in", tmp_path / name, "--fault", "B.clogging=0.3", "--noise", seed)
        for name, seed in (("out", "4"), ("again", "4"), ("other", "5"))
    )
    for name in ("a.csv", "b.csv.gz"):
        assert (out / name).read_bytes() == (again / name).read_bytes()
        assert (out / name).read_bytes() != (other / name).read_bytes()
    assert ["a.csv", "b.csv.gz"] == sorted(f.name for f in out.iterdir())
    plain = read_columns(simulated(HEALTHY, tmp_path / "plain.csv", "--fault", "B.clogging=0.3"))
    first, second = (
        np.mean(read_columns(out / name)["A.dp [bar]"] / plain["A.dp [bar]"] - 1.0)
        for name in ("a.csv", "b.csv.gz")
    )
    assert first == pytest.approx(second, abs=2e-4)
    assert abs(first) > 1e-3


def test_a_fault_is_there_in_its_period(tmp_path: Path) -> None:
    plain, found = (
        read_columns(simulated(HEALTHY, tmp_path / f"{len(options)}.csv", *options))["A.dp [bar]"]
        for options in ((), ("--fault", "A.dp.high=0.25@20:40"))
    )
    there = (np.arange(60) >= 20) & (np.arange(60) <= 40)
    assert found / plain == pytest.approx(np.where(there, 1.25, 1.0), rel=1e-6)


def test_rows_without_prediction(tmp_path: Path, capsys: Capsys) -> None:
    plant = ROOT / "tests" / "method" / "plants" / "abc-centrifugal"
    rows = ["time [s],A.n [rpm],B.n [rpm]", "0,2650,900", "1,0,900", "2,,900", "3,795,900", ""]
    (tmp_path / "in.csv").write_text("\n".join(rows))
    made = simulated(tmp_path / "in.csv", tmp_path / "out.csv", plant=plant)
    assert [True, False, False, False] == np.isfinite(read_columns(made)["C.dp [bar]"]).tolist()
    captured = capsys.readouterr()
    assert "4 rows, 1 of them predicted in full" in captured.out
    assert "1 of 4 rows (the first is data row 2): A.n is below " in captured.err
    assert "1 of 4 rows (the first is data row 3): A.n has no reading" in captured.err
    assert "1 of 4 rows (the first is data row 4) have no solution: no operating" in captured.err


def test_against_a_closed_valve(tmp_path: Path, capsys: Capsys) -> None:
    """A meter may show a little less than nothing where nothing flows."""
    knowledge = shutil.copytree(ROOT / "kb", tmp_path / "kb")
    plant = shutil.copytree(ROOT / "plants" / "esp-pump", tmp_path / "pump")
    module = knowledge / "modules" / "multistage-centrifugal.yaml"
    text = module.read_text(encoding="utf-8").partition("regimes:")[0]
    module.write_text(text.replace("minimum: 2, reference: 20", "reference: 20"), encoding="utf-8")
    inputs = tmp_path / "inputs.csv"
    flows = (0.0, -0.001, 0.01, 0.02, -5.0)
    rows = [f"{i},3000,{flow},998" for i, flow in enumerate(flows)]
    head = "time [s],pump.n [rpm],pump.Q [m3/h],pump.rho [kg/m3]"
    inputs.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    found = read_columns(simulated(inputs, tmp_path / "out.csv", plant=plant / "p37.yaml"))
    pressure = found["pump.dp [bar]"]
    assert np.isfinite(pressure).tolist() == [True, True, True, True, False]
    assert pressure[0] == pytest.approx(2.0 * pressure[2] - pressure[3], rel=1e-4)
    assert pressure[0] == pytest.approx(pressure[1], rel=1e-9)
    said = capsys.readouterr()
    assert "pump.Q shows no flow" in " ".join((said.out + said.err).split())


def test_a_real_pump_set(tmp_path: Path) -> None:
    folder = recordings_folder() / "zema-hydraulic"
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder} (set RULEC_RECORDINGS)")
    cycles = [c for c in read_cycles(folder) if c.leakage == 0 and c.settled]
    commissioning = set(sorted({c.block for c in cycles})[::3])
    unseen = [c.number for c in cycles if c.block not in commissioning and not c.off_profile]
    write_cycles(folder, unseen, tmp_path / "in.csv")
    plant = ROOT / "plants" / "zema-hydraulic"
    measured = read_columns(tmp_path / "in.csv")
    found = read_columns(simulated(tmp_path / "in.csv", tmp_path / "out.csv", plant=plant))
    assert list(measured) == list(found)
    second = measured["time [s]"] % 60.0
    plateaus = ((15, 18), (24, 28), (34, 38), (44, 48), (55, 59))
    settled = np.any([(second >= a) & (second < b) for a, b in plateaus], axis=0)
    assert 214 * 19 == settled.sum()
    for title, expected in (("FS1 [l/min]", 0.0033), ("EPS1 [W]", 0.0024)):
        off = found[title][settled] / measured[title][settled] - 1.0
        assert expected == pytest.approx(np.sqrt(np.mean(off**2)), abs=5e-5)


METER = """\
module: meter
version: 1
title: Meter
signals:
  y: {quantity: reading, unit: V, sensor: level-transmitter, range: [0, 10]}
parameters:
  g: {value: 100, unit: V/(m3/s), u: 2, title: gain, source: test}
readings:
  y: {is: g*inflow, source: linear}
faults: [slope(y)]
"""


def test_readings_without_states_are_refused(tmp_path: Path, capsys: Capsys) -> None:
    """A plant that has a meter and stores nothing: nothing follows from anything, which is said."""
    plant = plant_in(tmp_path, {"p": "voltage-pump", "m": "meter"}, "p -> m", meter=METER)
    inputs = tmp_path / "inputs.csv"
    inputs.write_text("time [s],p.u [V],m.y [V]\n0,4,0.001\n1,5,0.001\n", encoding="utf-8")
    assert 1 == main(["simulate", str(plant), str(inputs), "-o", str(tmp_path / "out.csv")])
    said = " ".join(capsys.readouterr().err.split())
    assert "no equation determines a reading" in said
