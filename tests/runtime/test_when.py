"""What is said of the end of a finding: ended, lasting, or not known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.recordings.when import course

from tests.runtime.sheets import Sheet, example, write

LEAK = example("leakage_A")


def moving_end(sheet: Sheet) -> Sheet:
    """The leakage of 51 s lasts, and from 58 s on every speed ramps."""
    rows = sheet.rows[:58]
    last = rows[-1]
    columns = [i for i, title in enumerate(sheet.header) if ".n [" in title]
    more = []
    for k in range(1, 13):
        cells = list(last)
        cells[0] = str(57 + k)
        for i in columns:
            cells[i] = str(float(last[i]) - 40.0 * k)
        more.append(tuple(cells))
    return replace(sheet, rows=(*rows, *more))


@pytest.mark.parametrize(
    ("sheet", "behind"),
    [
        (LEAK, None),
        (replace(LEAK, rows=LEAK.rows[:58]), ""),
        (moving_end(LEAK), "not judged"),
    ],
)
def test_what_follows_a_fault_is_said(
    sheet: Sheet, behind: str | None, tmp_path: Path, abc: Ruleset
) -> None:
    """A fault that ends, one that lasts to the end, one behind which nothing is settled."""
    found = diagnose(read_recording(write(tmp_path, sheet.text()), abc), abc)
    last = [f for f in found.findings if f.since == 51.0][-1]
    assert (behind, behind is not None) == (last.behind, last.active)
    text = course(None, last.since, last.until, last.behind)
    assert ("still active" in text) == last.active
    assert ("not settled" in text) == (behind == "not settled")
