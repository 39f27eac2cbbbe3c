"""Every format gives the same recording and the same diagnosis as a CSV file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.json_form import diagnosis_form

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
    """Recording and diagnosis are those of the CSV file, with the units that the file holds."""
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
    if not dated:
        plain = replace(found, notes=())
        wanted = diagnosis_form(diagnose(replace(expected, notes=()), abc))
        assert wanted == diagnosis_form(diagnose(plain, abc))
        assert wanted["findings"]
