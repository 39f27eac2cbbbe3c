"""Rows of a CSV file in parts; parts of plain numbers are converted at once."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice
from pathlib import Path

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.csv_table import RecordingRefused

BATCH = 1000
"""Rows read at a time: cells become numbers while they are still in the cache."""

Part = Array | list[list[str]]
"""Some rows: numbers, shape (rows, cells), NaN where a cell is empty, or the cells as text."""


def rows_of(path: Path, lines: Iterable[str], separator: str) -> Iterator[list[str]]:
    """Cells of the rows that are not empty. Raises `RecordingRefused`."""
    try:
        yield from filter(any, csv.reader(lines, delimiter=separator))
    except csv.Error as error:
        # A cell may hold anything else: only an unclosed quote makes one too large.
        raise RecordingRefused(
            f'{path}: not a readable CSV file ({error}); look for a quote (") that is not closed'
        ) from None


def batches_of(rows: Iterator[list[str]]) -> Iterator[Part]:
    """Rows in batches."""
    while batch := list(islice(rows, BATCH)):
        yield batch


def parts_of(
    path: Path, lines: Iterator[str], separator: str, above: int, wanted: tuple[int, Sequence[int]]
) -> Iterator[Part]:
    """Rows below the first `above` ones; as numbers if each cell is a number or empty, and each row
    has the `wanted` number of cells, of which those with the `wanted` indexes are finite."""
    rows = rows_of(path, lines, separator)
    for _ in islice(rows, above):
        pass
    while some := list(islice(lines, BATCH)):
        text = "".join(some)
        if '"' in text:
            # A quoted cell may continue on the next lines.
            yield from batches_of(rows_of(path, chain(some, lines), separator))
            return
        numbers = _numbers_of(text, separator, *wanted)
        yield [*rows_of(path, some, separator)] if numbers is None else numbers


def _numbers_of(text: str, separator: str, width: int, finite: Sequence[int]) -> Array | None:
    """Lines as numbers, shape (lines, width); None if a cell is a word, or if a row has another
    width, has empty cells alone, or is not finite where required.

    >>> _numbers_of("0,1.5\\n1,\\n", ",", 2, [0]).tolist()
    [[0.0, 1.5], [1.0, nan]]
    >>> [_numbers_of(t, ",", 2, [0]) for t in ("0,1.5\\n1,ok\\n", "0,1.5\\n1\\n", "0,1\\n,2\\n")]
    [None, None, None]
    """
    if not text.partition("\n")[0].strip():
        return None
    try:
        numbers = np.loadtxt(
            io.StringIO(_without_gaps(text, separator), newline=""),
            delimiter=separator,
            comments=None,
            ndmin=2,
        )
    except ValueError:
        return None
    if numbers.shape[1] != width or np.isnan(numbers).all(axis=1).any():
        return None
    return numbers if np.isfinite(numbers[:, finite]).all() else None


def _without_gaps(text: str, separator: str) -> str:
    """Lines with nan for empty cells.

    >>> _without_gaps(",,1\\r\\n2,,\\n", ",")
    'nan,nan,1\\r\\n2,nan,nan\\n'
    """
    if separator * 2 in text:
        # The first pass leaves every second of several adjacent gaps.
        for _ in range(2):
            text = text.replace(separator * 2, f"{separator}nan{separator}")
    for end in ("\n", "\r"):
        text = text.replace(separator + end, f"{separator}nan{end}")
    if text.startswith(separator):
        text = f"nan{text}"
    return text.replace(f"\n{separator}", f"\nnan{separator}")
