"""A maker's points become a module type; what is no sheet is refused with a reason."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xlsxwriter
import yaml

from rulec.cli import main
from rulec.commands.check_files import collect
from rulec.passes.pipeline import compile_plant
from tests.written import json_of, write_plant

NB = """\
Q [m3/h],H [m],eta [%],P2 [kW],P_el [kW],NPSHr [m],n [rpm]
1,33.25,1.9,4.755,5.149,2.19,2981
10,33.15,17.5,5.163,5.580,2.40,2979
20,33.01,31.8,5.641,6.087,2.59,2976
40,32.61,53.4,6.641,7.160,2.85,2971
60,31.82,67.9,7.651,8.258,3.08,2965
80,30.44,76.9,8.612,9.316,3.40,2959
100,28.22,81.1,9.464,10.27,3.94,2953
105,27.51,81.4,9.652,10.48,4.12,2952
108,27.05,81.4,9.761,10.60,4.24,2952
110,26.73,81.4,9.830,10.68,4.33,2951
114,26.07,81.1,9.961,10.83,4.51,2950
120,24.96,80.3,10.15,11.04,4.82,2949
130,22.85,77.6,10.41,11.34,5.43,2947
"""
"""Grundfos NB 65-160/157, product 97839240, curve tolerance ISO 9906:2012 grade 3B, as the maker's
Product Center gave it on 2026-10-02; water of 998.2 kg/m3."""

TYPE = "metered-centrifugal"
G = 9.80665


def written(folder: Path, text: str, name: str = "sheet.csv") -> str:
    """Path of a file with a text."""
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return str(file)


def rows() -> list[list[str]]:
    """Cells of the sheet, titles first."""
    return [line.split(",") for line in NB.splitlines()]


def imported(folder: Path, file: str, *more: str, kind: str = TYPE, code: int = 0) -> Any:
    """The machine form; the module stands in folder/kb/own.yaml."""
    (folder / "kb").mkdir(exist_ok=True)
    target = folder / "kb" / "own.yaml"
    return json_of("import", "curve", file, "--type", kind, "-o", target, *more, code=code)


def law(found: Any, name: str) -> dict[str, Any]:
    (one,) = [one for one in found["laws"] if one["law"] == name]
    return dict(one)


def test_points_of_a_real_sheet(tmp_path: Path) -> None:
    """Head and power of the maker within 2 % by the affinity laws; the grade stands in a size."""
    more = ("--grade", "3B", "--at", "n0=2950 rpm", "--source", "NB 65-160/157", "--columns")
    titles = "Q [m3/h],H [m],,,P_el [kW],NPSH [m],n [rpm]"
    found = imported(tmp_path, written(tmp_path, NB), *more, titles)
    for name, grade in (("dp_law", 0.07), ("P_law", 0.09)):
        one = law(found, name)
        assert one["points"] == 13
        assert one["largest"] < 0.02
        assert grade == one["tolerance"]
        assert grade / np.sqrt(6) == pytest.approx(one["u"], rel=0.06)
    file = tmp_path / "kb" / "own.yaml"
    assert [] == collect([file])
    compile_plant(write_plant(tmp_path, {"A": "own"}))
    data = yaml.safe_load(file.read_text(encoding="utf-8"))
    value = {name: p["value"] for name, p in data["parameters"].items()}
    for name, least in {"Q": 50 / 700, "dp": 0.05 / 0.88, "n": 300 / 2650}.items():
        own = data["signals"][name]
        assert own["minimum"] == pytest.approx(least * own["reference"], rel=0.01)
    flow, head, _, _, power, _, speed = np.array(rows()[1:], dtype=float).T
    nu, q = speed / value["n0"], 1e3 * flow
    dp = nu**2 * value["h0"] - nu * value["h1"] * q - value["h2"] * q**2
    drawn = nu**3 * value["p0"] + nu**2 * value["p1"] * q - nu * value["p2"] * q**2
    assert dp == pytest.approx(998.2 * G * head / 1e5, rel=0.02)
    assert drawn == pytest.approx(1e3 * power, rel=0.02)


def test_several_speeds_are_one_curve(tmp_path: Path) -> None:
    """Made by affinity from one parabola; the fit finds it, and says that the form was tested."""
    lines = ["n [rpm];Q [m3/h];dp [bar];M [Nm];rho [kg/m3]"]
    for n in (1500.0, 2400.0, 3000.0):
        for q in n / 3000 * np.array([5.0, 15.0, 25.0, 35.0]):
            speed, flow = n / 60, q / 3600
            dp = 1000 * (0.2 * speed**2 + 20 * speed * flow - 1.5e6 * flow**2)
            torque = 1000 * (5e-6 * speed**2 + 0.03 * speed * flow - 20 * flow**2)
            cells = (n, q, dp / 1e5, torque, 1000)
            lines.append(";".join(f"{cell:.6g}".replace(".", ",") for cell in cells))
    file = written(tmp_path, "\n".join(lines))
    found = imported(tmp_path, file, kind="multistage-centrifugal")
    value = {name: p["value"] for name, p in found["parameters"].items()}
    for name, true in {"a0": 0.2, "a1": 20, "a2": 1.5e6, "b0": 5e-6, "b1": 0.03, "b2": 20}.items():
        assert true == pytest.approx(value[name], rel=1e-3)
    assert law(found, "dp_law")["accuracy"] == "0.4 %, 19 of 20 of 12 points of the sheet"


def test_power_at_the_shaft_is_not_silently_that_of_the_motor(tmp_path: Path) -> None:
    """A sheet without electric power says from where the reading of power was taken."""
    titles, *points = rows()
    for kept, told in (
        (
            "Q [m3/h],H [m],P2 [kW],n [rpm]",
            "P_el taken as the power at the shaft, from column",
        ),
        ("Q [m3/h],H [m],eta [%],n [rpm]", "P_el taken as the power at the shaft, from flow,"),
    ):
        columns = [titles.index(title) for title in kept.split(",")]
        text = "\n".join([kept, *(",".join(row[i] for i in columns) for row in points)])
        found = imported(tmp_path, written(tmp_path, text), "--at", "n0=2950 rpm")
        assert 1 == sum("power" in note for note in found["notes"])
        assert [n for n in found["notes"] if n.startswith(told)]


def test_a_device_of_the_size_of_the_type(tmp_path: Path) -> None:
    """Within a half of the type's values, from which the fit finds it."""
    lines = ["n [rpm],dp [bar],Q [m3/h],P_el [kW]"]
    for share in np.linspace(0.1, 0.9, 6):
        dp = share * 998.2 * G * 131.0 / 1e5
        lines.append(f"1450,{dp:.6g},{7.45 * (1 - share):.6g},{0.43 + 2.19 * share:.6g}")
    found = imported(tmp_path, written(tmp_path, "\n".join(lines)), kind="side-channel-pump")
    for name in ("Q_law", "P_law"):
        assert law(found, name)["largest"] < 1e-3


def test_excel_and_a_digitised_table_say_the_same(tmp_path: Path) -> None:
    """A workbook with lines above its titles; two curves side by side, and no titles at all."""
    book = xlsxwriter.Workbook(str(tmp_path / "sheet.xlsx"))
    sheet = book.add_worksheet("curve")
    sheet.write(0, 0, "Curve of the maker")
    titles, *points = rows()
    for j, title in enumerate(titles):
        sheet.write(2, j, title.replace("P2", "note"))
        for i, row in enumerate(points, 3):
            sheet.write(i, j, float(row[j]))
    book.close()
    excel = imported(tmp_path, str(tmp_path / "sheet.xlsx"))
    digitised = "\n".join(f"{r[0]},{r[1]},{r[0]},{r[4]},{r[6]}" for r in points)
    titles_given = "Q [m3/h],H [m],Q [m3/h],P_el [kW],"
    file = written(tmp_path, digitised)
    pairs = imported(tmp_path, file, "--columns", titles_given, "--at", "n=2960 rpm")
    for name in ("dp_law", "P_law"):
        assert [13, 13] == [law(found, name)["points"] for found in (excel, pairs)]
        assert max(law(found, name)["largest"] for found in (excel, pairs)) < 0.03


def test_titles_swapped_leave_the_tolerance(tmp_path: Path, capsys: Any) -> None:
    """The units still fit, the curve does not: no file, unless somebody insists; then a doubt."""
    titles = "H [m],Q [m3/h],,,P_el [kW],,n [rpm]"
    file, target = written(tmp_path, NB), tmp_path / "kb" / "own.yaml"
    found = imported(tmp_path, file, "--columns", titles, code=1)
    assert not law(found, "dp_law")["holds"]
    assert not target.exists()
    assert "two columns swapped" in " ".join(capsys.readouterr().out.split())
    imported(tmp_path, file, "--columns", titles, "--force", "--at", "h0=90 bar")
    assert {("KB140", True)} == {(d.code, d.doubt) for d in collect([target])}


def test_electric_power_is_taken_before_that_of_the_shaft(tmp_path: Path) -> None:
    file = written(tmp_path, NB)
    titles = "Q [m3/h],H [m],,P2 [kW],P1 [kW],,n [rpm]"
    found = imported(tmp_path, file, "--columns", titles, "--at", "n0=2950 rpm")
    assert ["P_el, electric power, from column 'P1'"] == [n for n in found["notes"] if "P_el" in n]


def test_a_missing_speed_is_asked_for(tmp_path: Path, capsys: Any) -> None:
    file, titles = written(tmp_path, NB), "Q [m3/h],H [m],,,,,"
    call = ["import", "curve", file, "--type", TYPE, "--columns", titles]
    assert main([*call, "-o", str(tmp_path / "own.yaml")]) == 1
    assert "--at 'n=2900 rpm'" in " ".join(capsys.readouterr().err.split())
