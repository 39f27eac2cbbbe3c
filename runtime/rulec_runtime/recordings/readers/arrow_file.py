"""Arrow files (also called Feather): record batch by record batch."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import pyarrow

from rulec_runtime.recordings.readers.arrow_columns import ArrowPiece, arrow_sheet, pieces_of
from rulec_runtime.recordings.table import Sheet


def sheets(file: BinaryIO, path: Path, times: Collection[str]) -> list[Sheet]:
    """The one table of an Arrow file; units stand in the metadata of its fields."""
    source = pyarrow.ipc.open_file(file)
    rows = [source.get_batch(k).num_rows for k in range(source.num_record_batches)]

    def pieces(names: Sequence[str]) -> Iterator[ArrowPiece]:
        for number in range(source.num_record_batches):
            batch = pyarrow.Table.from_batches([source.get_batch(number)])
            yield from pieces_of(batch, names)

    return [arrow_sheet(path, file, source.schema, sum(rows), pieces, times)]
