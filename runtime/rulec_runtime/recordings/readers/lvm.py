"""Read LabVIEW measurement files (.lvm): text in segments, each with a head that gives its start.

Source: National Instruments, Specification for the LabVIEW Measurement File.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from itertools import chain, takewhile
from pathlib import Path
from typing import BinaryIO

from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.dates import date_of, time_of_day
from rulec_runtime.recordings.table import Sheet
from rulec_runtime.recordings.text_file import TextFile
from rulec_runtime.recordings.text_table import text_sheet
from rulec_runtime.recordings.time_column import COUNTINGS

_END = "***End_of_Header***"
_LABVIEW = next(one for one in COUNTINGS if one.since.startswith("1904"))


def sheets(file: BinaryIO, path: Path, _: Collection[str]) -> list[Sheet]:
    """The channels of all segments, which must be the same in each."""
    text = TextFile(file, path)
    head, titles, units = _begin(text, path)

    def rows() -> Iterator[list[str]]:
        return _rows(text, path, head, titles)

    shown = [f"{t} [{u}]" if u and "[" not in t else t for t, u in zip(titles, units, strict=True)]
    decimal = "," if _first(head, "Decimal_Separator") == "," else "."
    return [text_sheet(path, "", ["time", *shown], rows, ";" if decimal == "," else ",")]


def _separator(head: Mapping[str, Sequence[str]]) -> str:
    return "," if _first(head, "Separator").lower() == "comma" else "\t"


def _first(head: Mapping[str, Sequence[str]], tag: str) -> str:
    return next(iter(head.get(tag, ())), "").strip()


def _heads(lines: Iterator[str], defaults: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """Tags of a head, up to its end, added to the defaults."""
    found = {tag: list(cells) for tag, cells in defaults.items()}
    for line in lines:
        sign = _separator(found)
        cells = line.rstrip("\r\n").split(sign)
        tag = cells[0].strip()
        if tag == _END:
            break
        if tag == "Separator":
            sign = "," if "," in line else "\t"
            cells = line.rstrip("\r\n").split(sign)
        found[tag] = [cell.strip() for cell in cells[1:]]
    return found


def _begin(text: TextFile, path: Path) -> tuple[dict[str, list[str]], list[str], list[str]]:
    """The head of the file, and titles and units of its channels."""
    lines = text.lines()
    head = _heads(lines, {})
    segment = _heads((line for line in lines if line.strip()), head)
    titles = next(lines, "").rstrip("\r\n").split(_separator(head))
    channels = int(_first(segment, "Channels") or 0)
    if not channels or len(titles) < channels:
        raise RecordingRefused(
            f"{path}: no segment of this LabVIEW file has channels; write it with segment headers"
        )
    named = _channels(titles, channels, _first(head, "X_Columns"))
    units = [*segment.get("Y_Unit_Label", ()), *[""] * channels][:channels]
    return head, [titles[at].strip() for at in named], units


def _channels(titles: Sequence[str], channels: int, columns: str) -> list[int]:
    """Positions of the channels in a row: after one column of x, after one each, or from the first
    column on."""
    kind = columns.lower()
    # Without x its column may still exist, empty.
    first = 0 if kind == "no" and titles[0].strip() not in ("", "X_Value") else 1
    return [first + k * (2 if kind == "multi" else 1) for k in range(channels)]


def _rows(
    text: TextFile, path: Path, head: Mapping[str, Sequence[str]], titles: Sequence[str]
) -> Iterator[list[str]]:
    """Rows of all segments: a date, or seconds if no head has one, and the channels."""
    lines = text.lines()
    _heads(lines, {})
    kind, separator = _first(head, "X_Columns"), _separator(head)
    for line in lines:
        if not line.strip():
            continue
        segment = _heads(chain([line], lines), head)
        named = next(lines, "").rstrip("\r\n").split(separator)
        columns = _channels(named, len(titles), kind)
        if [named[p].strip() for p in columns if p < len(named)] != [*titles]:
            raise RecordingRefused(
                f"{path}: its segments hold different channels; export them as files of their own"
            )
        when = _times(segment, kind)
        for count, row in enumerate(takewhile(str.strip, lines)):  # an empty line ends it
            cells = row.rstrip("\r\n").split(separator)
            first = cells[0] if kind.lower() != "no" else ""
            yield [when(count, first), *(cells[p] if p < len(cells) else "" for p in columns)]


def _times(segment: Mapping[str, Sequence[str]], kind: str) -> Callable[[int, str], str]:
    """A function from the number of a row and its x to its time as text."""
    start = date_of(_first(segment, "Date"))[0] + time_of_day(_first(segment, "Time"))
    origin, step = (_number(_first(segment, tag)) for tag in ("X0", "Delta_X"))

    def when(count: int, cell: str) -> str:
        x = origin + count * step if kind.lower() == "no" else _number(cell)
        if x > _LABVIEW.numbers(1970):
            return _iso(x + _LABVIEW.start, "Z")
        return repr(x) if start != start else _iso(start + x, "")

    return when


def _iso(seconds: float, zone: str) -> str:
    return (datetime(1970, 1, 1) + timedelta(seconds=seconds)).isoformat() + zone


def _number(cell: str) -> float:
    try:
        return float(cell.replace(",", "."))
    except ValueError:
        return 0.0
