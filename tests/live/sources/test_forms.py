"""A file that a logger writes on, in the forms that recordings have: read as the whole one."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.sources.growing_file import GrowingFile
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.recording import read_recording

from tests.live.sources.taking import Taken
from tests.readers.test_strangers import BARE, DATES, FORMS, SHEET, beside, long, stamped
from tests.runtime.sheets import write

GROWING = {
    **{name: stamped(DATES[name]) for name in ("American, AM and PM", "historian", "Unix, ms")},
    **{name: FORMS[name] for name in ("thousands, German", "thousands, Swiss", "quality columns")},
    "a bad quality": beside("{} Quality", "Good").replace("1.82216,Good", "1.82216,Bad"),
}


@pytest.mark.parametrize("name", GROWING)
def test_a_growing_file_reads_as_the_whole_recording(
    name: str, tmp_path: Path, abc: Ruleset
) -> None:
    path = write(tmp_path, GROWING[name])
    expected, taken = read_recording(path, abc), Taken(GrowingFile(path, abc)).take()
    start = taken.times[0]
    np.testing.assert_allclose(np.array(taken.times) - start, expected.time, atol=1e-6)
    np.testing.assert_array_equal(taken.of("A.dp"), expected.values["A.dp"])


REFUSED = {
    "long": (long("tag,time,value", "{tag},{time},{value}"), {}),
    "in pairs": (beside("Time", "", time=True, before=True), {}),
    "readings that hold": (SHEET.text(), {"hold": "last"}),
    "dates of two readings": (BARE.filled("Timestamp", "3/4/2025 1:05").text(), {}),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_watch_cannot_follow_is_refused(name: str, tmp_path: Path, abc: Ruleset) -> None:
    text, form = REFUSED[name]
    ruleset = dataclasses.replace(abc, file=dataclasses.replace(abc.file, **form))
    with pytest.raises(RecordingRefused, match=r"watch reads tables with a column|may be 3 April"):
        Taken(GrowingFile(write(tmp_path, text), ruleset)).take()
