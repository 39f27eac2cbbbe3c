"""Recordings that go through memory in pieces give what they give as a whole."""

import gzip
from collections.abc import Callable
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady import limits as of_steady
from rulec_runtime.recordings import limits as of_recordings
from rulec_runtime.recordings import text_table
from rulec_runtime.recordings.larger_than_memory import array
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.json_form import diagnosis_form

from tests.conftest import ROOT, compiled
from tests.runtime.sheets import sampled, write

CLOSE = 1e-9
"""Products of matrices with other numbers of columns may differ in their last digits."""


@pytest.fixture
def tiny(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Makes pieces small, and puts all arrays into files."""

    def set_to() -> None:
        monkeypatch.setattr(of_recordings, "IN_MEMORY", 0)
        for name in ("POINTS_AT_ONCE", "RUNS_AT_ONCE"):
            monkeypatch.setattr(of_steady, name, 2)
        monkeypatch.setattr(text_table, "BATCH", 7)

    return set_to


def odd(recording: Recording) -> Recording:
    """With gaps, a pause, a reading that sticks and one that dies."""
    n = len(recording)
    values = {name: column.copy() for name, column in recording.values.items()}
    first, second, *_ = (v for v in values.values() if np.isfinite(v).all())
    first[n // 5 : n // 5 + 2] = np.nan
    first[n // 2 : n // 2 + 9] = np.nan
    second[-n // 3 :] = second[-n // 3]
    time = recording.time + np.where(np.arange(n) > n // 4, 500.0, 0.0)
    return replace(recording, values=values, time=time)


def again(recording: Recording) -> Recording:
    """The same three times, one behind the other."""
    values = {name: np.tile(column, 3) for name, column in recording.values.items()}
    return sampled(values, missing=recording.missing)


@pytest.mark.parametrize(
    ("plant", "name", "changed"),
    [
        ("abc", "leakage_A.csv", again),
        ("abc", "leakage_A.parquet", copy),
        ("abc", "swapped.csv", copy),
        ("abc", "step_B.csv", odd),
        ("mixing-rig", "clogging_D.csv", odd),
    ],
)
def test_same_findings(
    plant: str,
    name: str,
    changed: Callable[[Recording], Recording],
    tiny: Callable[[], None],
) -> None:
    rules, file = compiled(plant), ROOT / "plants" / plant / "examples" / name
    whole = diagnosis_form(diagnose(changed(read_recording(file, rules)), rules))
    tiny()
    pieces = diagnosis_form(diagnose(changed(read_recording(file, rules)), rules))
    assert_alike(whole, pieces)


def assert_alike(one: Any, other: Any) -> None:
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_alike(one[key], other[key])
    elif isinstance(one, list):
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            assert_alike(a, b)
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=CLOSE, abs=1e-15, nan_ok=True)
    else:
        assert one == other


def cells(row: Callable[[int], str], first: int = 0, header: str = "time [s],A.dp [bar]") -> str:
    return "\n".join([header, *map(row, range(first, 40))]) + "\n"


CELLS = {
    "dates": cells(lambda k: f"2026-01-01 00:{k:02d}:00,{k}", 0, "time,A.dp [bar]"),
    "comma": cells(lambda k: f"{k},5;{k},25", 0, "time [s];A.dp [bar]"),
    "late number": cells(lambda k: f"{k},{k}" if k > 8 else "x7,1.5", 0, "time,A.dp [bar]"),
    "disorder": cells(lambda k: f"{(7 * k) % 40},{k}"),
    "twice": cells(lambda k: f"{k // 2},{k}"),
    "no time": cells(lambda k: f"{k if k % 3 else ''},{k}"),
    "zones": cells(lambda k: f"2026-01-01T00:{k}:00+0{k // 20}:00,{k}", 20, "time,A.dp [bar]"),
    "ragged": cells(lambda k: f"{k},{k}{',' * (k % 5)}1"),
}


@pytest.mark.parametrize("name", CELLS)
def test_same_recording(name: str, tmp_path: Path, tiny: Callable[[], None]) -> None:
    rules = compiled("abc")
    file = write(tmp_path, gzip.compress(CELLS[name].encode()), "made.csv.gz")
    whole = read_recording(file, rules)
    tiny()
    pieces = read_recording(file, rules)
    np.testing.assert_array_equal(whole.time, pieces.time)
    np.testing.assert_array_equal(whole.values["A.dp"], pieces.values["A.dp"])
    assert (whole.notes, whole.clock) == (pieces.notes, pieces.clock)
    assert (whole.calendar, whole.left_out) == (pieces.calendar, pieces.left_out)


def test_full_disk_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(of_recordings, "IN_MEMORY", 0)
    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    with pytest.raises(Exception, match="TMPDIR"):
        array(10)
