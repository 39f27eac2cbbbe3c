"""Read Parquet and Arrow files."""

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO
from zoneinfo import ZoneInfo

import numpy as np
import pyarrow

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings import limits
from rulec_runtime.recordings.arrays import array_sheet, seconds_of
from rulec_runtime.recordings.csv_table import RecordingRefused, refuse_bomb
from rulec_runtime.recordings.dates import ahead_of_utc
from rulec_runtime.recordings.table import Dates, Sheet
from rulec_runtime.recordings.titles import is_time

PARQUET = b"PAR1"
"""First bytes of a Parquet file."""

Batches = Callable[[Sequence[str]], Iterable[Any]]
"""Gives record batches with the columns of these names."""

UNITS = (b"unit", b"units", b"Unit", b"Units")
"""Keys of a unit in a field's metadata."""

_INDEX = "__index_level_0__"
"""Name that pandas gives to an index without a name."""


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a Parquet or an Arrow file; units are in the metadata of its fields. Fields
    with lists or structures are skipped."""
    is_parquet = file.read(len(PARQUET)) == PARQUET
    file.seek(0)
    schema, rows, batches = _parquet(file) if is_parquet else _arrow(file)
    fields = [field for field in schema if not pyarrow.types.is_nested(field.type)]
    names = [field.name for field in fields]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise RecordingRefused(f"{path}: two columns are called '{twice}'; take one of them out")
    size = file.seek(0, os.SEEK_END)

    def pieces(indexes: Sequence[int]) -> Iterator[list[Any]]:
        refuse_bomb(path, rows * len(indexes) * np.dtype(float).itemsize, size)
        wanted = [names[i] for i in indexes]
        for batch in batches(wanted):
            table = pyarrow.Table.from_batches([batch])
            yield [_values(table.column(name)) for name in wanted]

    units = [_unit(field) for field in fields]
    return [array_sheet("", _titles(fields, times), units, rows, pieces)]


def _arrow(file: BinaryIO) -> tuple[Any, int, Batches]:
    """Schema, number of rows, and batches of an Arrow (Feather) file."""
    source = pyarrow.ipc.open_file(file)
    numbers = range(source.num_record_batches)
    rows = sum(source.get_batch(k).num_rows for k in numbers)
    return source.schema, rows, lambda _: (source.get_batch(k) for k in numbers)


def _parquet(file: BinaryIO) -> tuple[Any, int, Batches]:
    """The same for a Parquet file; batches hold the wanted columns alone."""
    import pyarrow.parquet

    source = pyarrow.parquet.ParquetFile(file, buffer_size=limits.PARQUET_BUFFER, pre_buffer=False)

    def batches(names: Sequence[str]) -> Iterator[Any]:
        # Each thread would keep memory of its own, and reading is not the bottleneck.
        yield from source.iter_batches(limits.PARQUET_ROWS, columns=names, use_threads=False)
        pyarrow.default_memory_pool().release_unused()

    return source.schema_arrow, source.metadata.num_rows, batches


def _titles(fields: Sequence[Any], times: Collection[str]) -> list[str]:
    """Names of the fields; a pandas index of dates is the time if no field has such a name."""
    titles = [field.name for field in fields]
    if not any(is_time(title, times) for title in titles):
        for k, field in enumerate(fields):
            if field.name == _INDEX and pyarrow.types.is_temporal(field.type):
                titles[k] = "time"
    return titles


def _unit(field: Any) -> str:
    if pyarrow.types.is_duration(field.type):
        return "s"
    metadata = field.metadata or {}
    found = next((metadata[key] for key in UNITS if key in metadata), b"")
    return str(found.decode("utf-8", "replace"))


def _values(column: Any) -> Any:
    """Values of a column: numbers (NaN where null), dates, or text."""
    kind = column.type
    if pyarrow.types.is_dictionary(kind):
        column = pyarrow.chunked_array([c.dictionary_decode() for c in column.chunks])
        kind = column.type
    if pyarrow.types.is_date(kind):
        column = column.cast(pyarrow.timestamp("us"))
        kind = column.type
    if pyarrow.types.is_timestamp(kind):
        seconds = seconds_of(_ticks(column).view(f"M8[{kind.unit}]"))
        return Dates(seconds, _zones(seconds, kind.tz))
    if pyarrow.types.is_duration(kind):
        return _ticks(column).view(f"m8[{kind.unit}]")
    if pyarrow.types.is_boolean(kind) or pyarrow.types.is_decimal(kind):
        column = column.cast(pyarrow.float64())
    if pyarrow.types.is_null(kind):
        return np.full(len(column), np.nan)
    if pyarrow.types.is_integer(kind) or pyarrow.types.is_floating(column.type):
        return _filled(column.cast(pyarrow.float64(), safe=False), np.nan)
    return np.array(column.to_pylist(), dtype=object)


def _ticks(column: Any) -> np.ndarray:
    """Dates or durations as integers of their unit; null becomes numpy's NaT."""
    return _filled(column.cast(pyarrow.int64()), np.iinfo(np.int64).min)


def _filled(column: Any, missing: float) -> np.ndarray:
    """Numbers of a column, shape (n,), `missing` where null.

    `to_numpy` of pyarrow loads pandas, which takes more memory than a long recording.
    """
    found = np.full(len(column), missing)
    begin = 0
    for chunk in column.chunks:
        part = found[begin : begin + len(chunk)]
        valid = np.from_dlpack(chunk.is_valid().cast(pyarrow.uint8())).astype(bool)
        part[valid] = np.from_dlpack(chunk.drop_null() if chunk.null_count else chunk)
        begin += len(chunk)
    return found


def _zones(seconds: Array, zone: str | None) -> Array:
    """Seconds ahead of UTC of dates in UTC, NaN without a zone."""
    if zone is None:
        return np.full(len(seconds), np.nan)
    if zone[:1] in "+-":
        return ahead_of_utc(datetime.strptime(zone, "%z").tzinfo or UTC, seconds)
    return ahead_of_utc(ZoneInfo(zone), seconds)
