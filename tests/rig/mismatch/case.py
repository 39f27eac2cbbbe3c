"""One question to the tool: a plant, a recording that it sees, and one that it does not."""

from __future__ import annotations

import csv
import gzip
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from tests.conftest import ROOT

Row = Mapping[str, str]


@dataclass(frozen=True)
class Case:
    """`by_hand` says what a person found: root mean square errors on the unseen part."""

    name: str
    plant: Path
    analysis: Path
    unseen: Path
    by_hand: str = ""


def copy_plant(name: str, folder: Path, file: str = "plant.yaml") -> Path:
    """Copy a shipped plant next to nothing else; returns the plant file, which knows its kb."""
    place = folder / name
    if not place.exists():
        shutil.copytree(ROOT / "plants" / name, place)
    plant = place / file
    text = plant.read_text(encoding="utf-8")
    if "\nkb:" not in text:
        plant.write_text(f"{text.rstrip()}\nkb: {ROOT / 'kb'}\n", encoding="utf-8")
    return plant


def copy_rows(
    source: Path,
    target: Path,
    wanted: Callable[[Row], bool],
    without: Iterable[str] = (),
) -> int:
    """Copy some rows of a table, without some columns; returns how many rows.

    Raises `KeyError` where a column to leave out does not exist.
    """
    left_out, count = set(without), 0
    with _opened(source) as file, target.open("w", newline="", encoding="utf-8") as out:
        rows = csv.DictReader(file)
        header = list(rows.fieldnames or ())
        if strangers := left_out - set(header):
            raise KeyError(f"{source.name} has no column {', '.join(sorted(strangers))}")
        writer = csv.DictWriter(out, [h for h in header if h not in left_out])
        writer.writeheader()
        for row in rows:
            if wanted(row):
                writer.writerow({h: v for h, v in row.items() if h not in left_out})
                count += 1
    return count


def read_columns(file: Path, *titles: str) -> Iterator[list[str]]:
    """Cells of some columns, row by row."""
    with _opened(file) as source:
        for row in csv.DictReader(source):
            yield [row[t] for t in titles]


@contextmanager
def _opened(file: Path) -> Iterator[IO[str]]:
    """A table, packed or not."""
    if file.suffix == ".gz":
        with gzip.open(file, "rt", encoding="utf-8", newline="") as packed:
            yield packed
    else:
        with file.open(encoding="utf-8", newline="") as plain:
            yield plain
