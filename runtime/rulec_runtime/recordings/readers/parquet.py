"""Parquet files: some rows after the other, the wanted columns alone."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import pyarrow.parquet

from rulec_runtime import limits
from rulec_runtime.recordings.readers.arrow_columns import ArrowPiece, arrow_sheet, pieces_of
from rulec_runtime.recordings.table import Sheet


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a Parquet file; units stand in the metadata of its fields."""
    source = pyarrow.parquet.ParquetFile(file, buffer_size=limits.PARQUET_BUFFER, pre_buffer=False)
    schema = source.schema_arrow

    def pieces(names: Sequence[str]) -> Iterator[ArrowPiece]:
        # Threads would each keep memory of their own, and reading is not what takes long.
        wanted = {"columns": list(names), "use_threads": False}
        for batch in source.iter_batches(limits.PARQUET_ROWS, **wanted):
            yield from pieces_of(pyarrow.Table.from_batches([batch]), names)
        pyarrow.default_memory_pool().release_unused()

    return [arrow_sheet(path, file, schema, source.metadata.num_rows, pieces, times)]
