"""Rows that are read as numbers all at once are the same as those that are read cell by cell."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.recordings import text_parts, text_table
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.table import Table

ROWS = 40
CELLS = ("1", "2.5", "-3e-2", "", "", " 7 ", "nan", "NA", "-", "ok", "1,5", "1_0", "inf", '"8"',
         "0x1")  # fmt: skip
"""What may stand in a cell; those at the front come most often."""


@pytest.fixture(autouse=True)
def _few_rows_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (text_parts, text_table):
        monkeypatch.setattr(module, "BATCH", 8)


def read(text: str) -> Table | str:
    """Times as they are kept and two columns of numbers, or why the file is refused."""
    file = Path("x.csv")
    try:
        (sheet,) = text_table.sheets(io.BytesIO(text.encode()), file, ("time",))
        return sheet.read([0], [1, 2])
    except RecordingRefused as error:
        return str(error)


def cell_by_cell(text: str, monkeypatch: pytest.MonkeyPatch) -> Table | str:
    with monkeypatch.context() as changed:
        rows = text_parts.batches_of
        changed.setattr(text_table.TextTable, "_parts", lambda table, _: rows(table._below()))
        return read(text)


def told(table: Table | str) -> object:
    if isinstance(table, str):
        return table
    columns = [
        (c.numbers().tobytes(), c.states, c.first, c.words, sorted(c.decimals - {"."}))
        for c in table.columns
    ]
    kept = [np.asarray(k, dtype=float).tobytes() for k in table.kept if isinstance(k, np.ndarray)]
    return columns, kept, table.left_out, table.first_left_out


def files() -> Iterator[str]:
    random = np.random.default_rng(7)
    for separator in ",;\t":
        for words in (2, 4, 6, 9, len(CELLS)):
            for end in ("\n", "\r\n"):
                lines = [separator.join(("time", "a", "b"))]
                for row in range(ROWS):
                    some = [str(random.choice(CELLS[:words])) for _ in range(2)]
                    lines.append(separator.join((str(row), *some)))
                    if random.random() < 0.02 * words:
                        odd = random.choice(["", "  ", separator * 2, "1", f"9{separator}"])
                        lines.append(str(odd))
                yield end.join(lines) + end * int(random.integers(2))


def test_files_of_all_kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    several, at_once = [*files()], 0
    numbers_of = text_parts._numbers_of

    def counted(*of: object) -> object:
        nonlocal at_once
        found = numbers_of(*of)  # type: ignore[arg-type]
        at_once += found is not None
        return found

    monkeypatch.setattr(text_parts, "_numbers_of", counted)
    for text in several:
        assert told(read(text)) == told(cell_by_cell(text, monkeypatch)), text
    assert len(several) <= at_once < len(several) * ROWS // 8


def test_a_cell_in_quotes_that_goes_on_behind_the_last_row_of_a_part() -> None:
    lines = ["time,a,b", *(f"{i},{i},1" for i in range(7)), '7,"7', '",2', "8,8,3"]
    table = read("\n".join(lines))
    assert not isinstance(table, str)
    assert table.columns[1].numbers().tolist() == [1.0] * 7 + [2.0, 3.0]
