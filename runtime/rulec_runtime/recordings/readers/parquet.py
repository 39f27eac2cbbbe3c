"""Parquet files: row group by row group, the wanted columns alone."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import pyarrow.parquet

from rulec_runtime.recordings.readers.arrow_columns import ArrowPiece, arrow_sheet, pieces_of
from rulec_runtime.recordings.table import Sheet


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of a Parquet file; units stand in the metadata of its fields."""
    source = pyarrow.parquet.ParquetFile(file)
    schema = source.schema_arrow

    def pieces(names: Sequence[str]) -> Iterator[ArrowPiece]:
        for group in range(source.num_row_groups):
            yield from pieces_of(source.read_row_group(group, columns=list(names)), names)

    return [arrow_sheet(path, file, schema, source.metadata.num_rows, pieces, times)]
