"""Results of a fleet: a file per plant-day, written at once when it is done, and tables per day.

A plant-day is done if its file exists. The name of the file holds the key of the work, so the same
work is not done twice, and other work (a new ruleset, a changed recording) replaces it.
"""

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from rulec_runtime.fleet.plant_day import POINTS, Row, Task
from rulec_runtime.output.refusal import Refusal, to_install
from rulec_runtime.output.write_file import write_data

DONE, HEALTH, FINDINGS, TRACE = "plant-days", "health", "findings", "trace"

COLUMNS = {
    HEALTH: "plant day status: string; health coverage: double; samples judged: int64; "
    "reason ruleset: string",
    FINDINGS: "kind fault module status text action: string; "
    "degree lower upper probability since until: double; active: bool",
    TRACE: "since until: double; samples: int64; verdict: string; largest_degree: double",
    POINTS: "signal: string; since until: double; samples: int64; value u: double",
}
"""Columns of each table, and their types as pyarrow names them."""

Fields = list[tuple[str, Any]]
"""Names of columns, each with its type."""


def _fields(table: str) -> Fields:
    groups = (group.split(": ") for group in COLUMNS[table].split("; "))
    return [(name, kind) for names, kind in groups for name in names.split(" ")]


class PlantDays:
    """Files of plant-days below `room` of a folder, with names that end in `suffix`."""

    def __init__(self, folder: Path, plant_key: str, day_key: str, room: str, suffix: str) -> None:
        self.folder, self._plant, self._day = folder, plant_key, day_key
        self._room, self._suffix = room, suffix

    def is_done(self, task: Task) -> bool:
        """Whether this very work was done."""
        return self.file(task).is_file()

    def file(self, task: Task) -> Path:
        """The file for the result of a plant-day."""
        day, plant = (quote(part, safe="") for part in (task.day, task.plant))
        folder = self.folder / self._room / f"{self._day}={day}" / f"{self._plant}={plant}"
        return folder / f"{task.key}{self._suffix}"

    def put(self, task: Task, data: bytes) -> None:
        """Write the result of a plant-day; it replaces an earlier one."""
        file = self.file(task)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_data(file, data)
        for other in file.parent.glob(f"*{self._suffix}"):
            if other != file:
                other.unlink()


class Store(PlantDays):
    """Results in a folder."""

    def __init__(self, folder: Path, plant_key: str, day_key: str) -> None:
        super().__init__(folder, plant_key, day_key, DONE, ".parquet")
        try:
            import pyarrow.parquet
        except ModuleNotFoundError:
            raise Refusal(
                "results of a fleet are Parquet files; install what they need: "
                f"{to_install('fleet', 'rulec')}"
            ) from None
        self._arrow = pyarrow
        self._health = [*_fields(HEALTH), ("notes", pyarrow.list_(pyarrow.string()))]

    def keep(self, task: Task, row: Row) -> None:
        """Write the row of a plant-day; it replaces an earlier one."""
        list_, struct = self._arrow.list_, self._arrow.struct
        parts = [(name, list_(struct(_fields(name)))) for name in (FINDINGS, TRACE, POINTS)]
        self.put(task, parquet_of([row], [*self._health, *parts]))

    def rows(self, tasks: Iterable[Task]) -> list[Row]:
        """The rows of plant-days that are done."""
        read = self._arrow.parquet.ParquetFile
        return [row for task in tasks for row in read(self.file(task)).read().to_pylist()]

    def write_tables(self, day: str, rows: Sequence[Row]) -> None:
        """Flat tables of a day: health, findings and trace."""
        self._table(HEALTH, day, rows, self._health)
        for kind in (FINDINGS, TRACE):
            flat = [{"plant": row["plant"], **part} for row in rows for part in row[kind]]
            self._table(kind, day, flat, [("plant", "string"), *_fields(kind)])

    def _table(self, kind: str, day: str, rows: Sequence[Row], fields: Fields) -> None:
        file = self.folder / kind / f"{self._day}={quote(day, safe='')}" / f"{kind}.parquet"
        file.parent.mkdir(parents=True, exist_ok=True)
        # The name of the folder contains the day.
        write_data(file, parquet_of(rows, [field for field in fields if field[0] != "day"]))


def parquet_of(rows: Iterable[Mapping[str, Any]], fields: Fields) -> bytes:
    """A table as a Parquet file."""
    import pyarrow.parquet

    kept = [{name: row[name] for name, _ in fields} for row in rows]
    buffer = io.BytesIO()
    table = pyarrow.Table.from_pylist(kept, schema=pyarrow.schema(fields))
    pyarrow.parquet.write_table(table, buffer)
    return buffer.getvalue()


def tables(store: Store, tasks: Sequence[Task], advance: Callable[[int], None]) -> list[Row]:
    """Write the tables of all days; returns the health of all plant-days, by day and plant."""
    days: dict[str, list[Task]] = {}
    for task in tasks:
        days.setdefault(task.day, []).append(task)
    found: list[Row] = []
    for number, (day, own) in enumerate(days.items(), 1):
        rows = store.rows(own)
        store.write_tables(day, rows)
        found += [_short(row) for row in rows]
        advance(number)
    return found


def _short(row: Row) -> Row:
    """Health of a plant-day, with its worst finding in words."""
    faults = [f for f in row[FINDINGS] if f["text"]]
    worst = min(faults, key=lambda f: ("FCSM".find(f["status"]), f["since"]), default=None)
    short = {k: v for k, v in row.items() if k not in (FINDINGS, TRACE, POINTS, "notes")}
    count = len(row[FINDINGS])
    return short | {"found": count, "text": worst["text"] if worst else row["reason"]}
