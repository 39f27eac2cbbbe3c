"""Recordings in memory say what their files say, and are refused as files are."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording

import rulec
from rulec.commands.arguments import recording_given
from tests.conftest import ROOT, compiled

FILE = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
TIME = "time [s]"

FRAMES: dict[str, Callable[[pd.DataFrame], Any]] = {
    "pandas": lambda frame: frame,
    "index": lambda frame: frame.set_index(TIME),
    "polars": pl.from_pandas,
    "lazy": lambda frame: pl.from_pandas(frame).lazy(),
    "pyarrow": pa.Table.from_pandas,
    "arrays": lambda frame: {title: frame[title].to_numpy() for title in frame.columns},
}


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    """The file as pandas reads it."""
    return pd.read_csv(FILE)


def read(data: Any, ruleset: Ruleset | None = None) -> Recording:
    return recording_given([data], ruleset or compiled("abc"))


@pytest.mark.parametrize("kind", FRAMES)
def test_a_frame_is_read_as_its_file(kind: str, frame: pd.DataFrame) -> None:
    """The same times, the same readings in SI, nothing to remark."""
    of_file, found = read(FILE), read(FRAMES[kind](frame))
    assert of_file.time.tolist() == found.time.tolist()
    assert of_file.values.keys() == found.values.keys()
    for name, values in of_file.values.items():
        np.testing.assert_allclose(values, found.values[name], rtol=1e-14)
    assert of_file.notes == found.notes


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"A.dp [bar]": [1.0]}, "data frame: there is no time column; expected 'time [s]'"),
        ({TIME: [0, 1], "A.dp [bar]": [1.0]}, "different numbers of rows: 'time [s]' 2"),
        ({TIME: [0, 1], "A.dp [bar]": np.ones((2, 2))}, "has the shape (2, 2); give one number"),
        (
            {TIME: [0, 1], "A.dp [bar]": pd.date_range("2025", periods=2)},
            "holds dates or times, not readings",
        ),
        (
            {TIME: [0, 1], "A.dp [rpm]": [1.0, 1.0]},
            "'A.dp [rpm]': it is in rpm, but A.dp is measured",
        ),
        ([], "give one recording at least"),
        (42, "int is no recording; give a path, a data frame of pandas, polars, pyarrow"),
        (Path("nowhere.csv"), "nowhere.csv: there is no such file"),
    ],
)
def test_what_is_no_recording_is_refused(data: Any, said: str) -> None:
    """Typed, with the message that says what to do."""
    plant = ROOT / "plants" / "abc"
    with pytest.raises((rulec.Refusal, rulec.Misused)) as refused:
        rulec.mismatch(plant, data)
    assert said in str(refused.value)


def test_frames_and_files_are_put_together(frame: pd.DataFrame) -> None:
    """In the order given, each by its name; not the same twice."""
    found = recording_given([frame, FILE], compiled("abc"))
    assert ("data frame 1", "leakage_A.csv") == found.sources
    assert 160 == len(found)
    with pytest.raises(rulec.RecordingRefused, match="given twice"):
        recording_given([frame, frame], compiled("abc"))
