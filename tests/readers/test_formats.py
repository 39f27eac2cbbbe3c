"""Every format gives the same recording as a CSV file."""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.cli import main
from tests.readers.conftest import ABC
from tests.readers.writers import WRITERS, readings_of
from tests.runtime.sheets import example, write

READINGS = readings_of(example("leakage_A"))
KEPT_BY = {"openpyxl.xlsx": "1 row above the titles left out"}
"""Remarks that belong to what a file holds beside the table."""


def same(expected: Recording, found: Recording) -> None:
    """Every number is the same, to the last bit."""
    np.testing.assert_array_equal(found.time, expected.time)
    assert expected.values.keys() == found.values.keys()
    for name, values in expected.values.items():
        np.testing.assert_array_equal(found.values[name], values, err_msg=name)
    np.testing.assert_array_equal(found.segment, expected.segment)
    assert expected.calendar == found.calendar
    assert expected.missing == found.missing
    assert expected.scales == found.scales
    assert expected.clock == found.clock


CASES = [(name, False) for name in WRITERS] + [(name, True) for name in WRITERS if WRITERS[name][1]]


@pytest.mark.parametrize(("name", "dated"), CASES)
def test_every_format_gives_the_same(name: str, dated: bool, tmp_path: Path, abc: Ruleset) -> None:
    """The recording, so its diagnosis, is that of the CSV file, with the units of the file."""
    writer, _, units = WRITERS[name]
    csv = write(tmp_path, READINGS.csv(dated, units), "x.csv")
    file = tmp_path / f"x{Path(name).suffix}"
    writer(file, READINGS, dated)
    expected, found = read_recording(csv, abc), read_recording(file, abc)
    zoned = name in ("openpyxl.xlsx", "xlsxwriter.xlsx")  # Excel knows no zones
    if dated and zoned:
        bare = write(tmp_path, READINGS.csv(dated, units).replace("Z,", ","), "x.csv")
        expected = read_recording(bare, abc)
    same(expected, found)
    beside = KEPT_BY.get(name)
    notes = [note.replace(file.name, "x.csv") for note in found.notes]
    assert sorted(expected.notes) == sorted(n for n in notes if not (beside and beside in n))


@pytest.mark.parametrize("name", ["pyarrow.parquet", "openpyxl.xlsx", "asammdf4.mf4"])
def test_binary_files_come_through_a_pipe(
    name: str, tmp_path: Path, abc: Ruleset, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / f"x{Path(name).suffix}"
    WRITERS[name][0](file, READINGS, False)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(file.read_bytes())))
    same(read_recording(file, abc), read_recording(Path("-"), abc))


@pytest.mark.parametrize("name", ["openpyxl.xlsx", "h5py.h5"])
def test_simulated_recordings_are_written_as_csv(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With titles and units of the file, and dates as it holds them; a folder file by file."""
    folder = tmp_path / "runs"
    folder.mkdir()
    file = folder / f"x{Path(name).suffix}"
    WRITERS[name][0](file, READINGS, True)
    assert 0 == main(["simulate", str(ABC), str(folder), "-o", str(tmp_path / "out")])
    written = (tmp_path / "out" / "x.csv").read_text(encoding="utf-8").splitlines()
    assert {"A.n [rpm]", "A.dp [bar]", "C.dp [bar]"} <= set(written[0].split(","))
    assert 81 == len(written)
    row = dict(zip(written[0].split(","), written[1].split(","), strict=True))
    time = next(value for title, value in row.items() if title.startswith("time"))
    assert time.startswith("2025-03-31T14:05:00")
    assert READINGS.columns["A.n"][1][0] == float(row["A.n [rpm]"])
    assert 2 == main(["simulate", str(ABC), str(file), "-o", str(tmp_path / "out.parquet")])
    assert "recordings are written as CSV; name it .csv" in capsys.readouterr().err
    assert not (tmp_path / "out.parquet").exists()
