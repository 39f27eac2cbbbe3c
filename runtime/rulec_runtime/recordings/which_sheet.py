"""Which table of a file is meant: the one with a time, or the one named."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.titles import is_time

SHOWN = 8


def which(path: Path, sheets: Sequence[Sheet], name: str, times: Collection[str]) -> Sheet:
    """The table called `name`; without one, the only one with a time column.

    Tables have clocks of their own, and nothing puts them on one. Raises `RecordingRefused`.
    """
    if name:
        for sheet in sheets:
            if sheet.name.strip("/") == name:
                return sheet
        raise RecordingRefused(
            f"{path}: there is no table '{name[:40]}' in it{_listed(sheets, times)}"
        )
    timed = [sheet for sheet in sheets if any(is_time(title, times) for title in sheet.titles)]
    if len(timed) == 1:
        return timed[0]
    if timed:
        raise RecordingRefused(
            f"{path}: it holds {len(timed)} tables with times of their own, which are not put on "
            f"one clock; name one, as in '{path.name}#{timed[0].name.strip('/')}'"
            f"{_listed(timed, times)}"
        )
    if len(sheets) == 1:
        return sheets[0]
    raise RecordingRefused(f"{path}: no table in it has a time column{_listed(sheets, times)}")


def _listed(sheets: Sequence[Sheet], times: Collection[str]) -> str:
    shown = [_described(sheet, times) for sheet in sheets[:SHOWN]]
    more = f" and {len(sheets) - SHOWN} more" if len(sheets) > SHOWN else ""
    return f": {'; '.join(shown)}{more}" if shown else ""


def _described(sheet: Sheet, times: Collection[str]) -> str:
    """Its name, and titles where one is a time: of a file of others nothing else is quoted."""
    if not any(is_time(title, times) for title in sheet.titles):
        return f"'{sheet.name.strip('/')}'"
    rows = "" if sheet.rows is None else f"{sheet.rows} rows of "
    titles = ", ".join(title.strip() for title in sheet.titles[:3])
    more = ", ..." if len(sheet.titles) > 3 else ""
    return f"'{sheet.name.strip('/')}' ({rows}{titles}{more})"
