"""Read Excel workbooks (.xlsx): each sheet with a row of titles is a table."""

import os
import zipfile
from collections.abc import Collection, Iterator
from datetime import date, datetime, time, timedelta
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import openpyxl

from rulec_runtime.output.plural import plural
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.csv_table import RecordingRefused, refuse_bomb
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.text_table import text_sheet
from rulec_runtime.recordings.titles import are_titles

PIECE = 1 << 20


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """Tables of a workbook: values as calculated when it was saved, no formulas."""
    _check(file, path)
    book = openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
    found = [_sheet(path, page, times) for page in book.worksheets]
    tables = [sheet for sheet in found if sheet is not None]
    if not tables:
        raise RecordingRefused(
            f"{path}: no sheet of this workbook has a row of titles, one of them that of a time, "
            "as in 'time [s]'"
        )
    return tables


def _check(file: BinaryIO, path: Path) -> None:
    """Refuse a packed file that is no workbook, that unpacks to far more than its size, or that
    declares entities, which no workbook needs."""
    size = file.seek(0, os.SEEK_END)
    file.seek(0)
    with zipfile.ZipFile(file) as packed:
        names = packed.namelist()
        if "xl/workbook.xml" not in names:
            raise RecordingRefused(
                f"{path}: this packed file is no Excel workbook; unpack it, or export as CSV"
            )
        refuse_bomb(path, sum(part.file_size for part in packed.infolist()), size)
        for name in names:
            with packed.open(name) as part:
                begin = part.read(PIECE)
                if b"<!DOCTYPE" in begin or b"<!ENTITY" in begin:
                    raise RecordingRefused(
                        f"{path}: {name[:60]} in it declares a document type, as no workbook does; "
                        "it is not read"
                    )
                while part.read(PIECE):  # the checksum verifies the stated size
                    pass
    file.seek(0)


def _sheet(path: Path, page: Any, times: Collection[str]) -> Sheet | None:
    """The table of a sheet; None if no row holds titles."""
    first = list(islice(_rows(page), limits.LINES_ABOVE_TITLES))
    at = next((k for k, row in enumerate(first) if are_titles(row, times)), None)
    if at is None:
        return None
    titles = first[at]
    while titles and not titles[-1].strip():
        titles = titles[:-1]
    above = (f"{plural(at, 'row', 'rows')} above the titles left out",) if at else ()
    width = len(titles)

    def below() -> Iterator[list[str]]:
        # Empty cells at the end of a row are not stored.
        return ([*row, *[""] * (width - len(row))] for row in islice(_rows(page), at + 1, None))

    return text_sheet(path, page.title, titles, below, ",", above)


def _rows(page: Any) -> Iterator[list[str]]:
    """Rows that are not empty; the stated size of a sheet is not trusted."""
    page.reset_dimensions()
    for row in page.iter_rows(values_only=True):
        cells = [_text(value) for value in row]
        if any(cells):
            yield cells


def _text(value: Any) -> str:
    """A cell as in a CSV file."""
    match value:
        case None:
            return ""
        case bool():
            return str(int(value))
        case datetime() | date():
            return value.isoformat()
        case timedelta():
            return repr(value.total_seconds())
        case time():
            return repr((datetime.combine(date.min, value) - datetime.min).total_seconds())
    return str(value)
