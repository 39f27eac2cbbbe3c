"""Results of a fleet: a file per plant-day, written at once when it is done, and tables per day.

A plant-day is done if its file exists. The name of the file holds the key of the work, so the same
work is not done twice, and other work (a new ruleset, a changed recording) replaces it.
"""

import io
import json
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import quote

from rulec_runtime.fleet.plant_day import POINTS, Row, Task
from rulec_runtime.output.refusal import Refusal, to_install
from rulec_runtime.output.write_file import write_data, write_text

from rulec.fleet.fleet_file import Fleet

DONE, HEALTH, FINDINGS, TRACE = "plant-days", "health", "findings", "trace"
ANSWERS, MISMATCH = "mismatch-answers", "mismatch"

COLUMNS = {
    HEALTH: "plant status: string; health coverage: double; samples judged: int64; "
    "reason ruleset: string; notes: strings",
    FINDINGS: "plant kind fault module status text action: string; "
    "degree lower upper probability since until: double; active: bool",
    TRACE: "plant: string; since until: double; samples: int64; verdict: string; "
    "largest_degree: double",
    MISMATCH: "plant day verdict text reason module place effect title: string; "
    "probability: double; signal unit: string; shipped recalibrated repaired noise: double",
}
"""Columns of each table, and their types as pyarrow names them."""

Fields = list[tuple[str, str]]
"""Names of columns, each with its type."""


def fields_of(table: str) -> Fields:
    """Return the columns of a table."""
    groups = (group.split(": ") for group in COLUMNS[table].split("; "))
    return [(name, kind) for names, kind in groups for name in names.split(" ")]


class Store:
    """Results of the plant-days of a fleet: JSON files below `room` of its folder."""

    def __init__(self, fleet: Fleet, room: str = DONE) -> None:
        self._fleet, self._room = fleet, room
        if find_spec("pyarrow") is None:
            raise Refusal(
                "results of a fleet are Parquet files; install what they need: "
                f"{to_install('fleet', 'rulec')}"
            )

    def is_done(self, task: Task) -> bool:
        """Whether this very work was done."""
        return self.file(task).is_file()

    def file(self, task: Task) -> Path:
        """The file for the result of a plant-day."""
        return (
            self._folder(self._room, task.day)
            / _part(self._fleet.plant_key, task.plant)
            / (f"{task.key}.json")
        )

    def _folder(self, room: str, day: str) -> Path:
        return self._fleet.results / room / _part(self._fleet.day_key, day)

    def keep(self, task: Task, result: Row) -> None:
        """Write the result of a plant-day; it replaces an earlier one."""
        file = self.file(task)
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, json.dumps(result, indent=1, ensure_ascii=False) + "\n")
        for other in file.parent.glob("*.json"):
            if other != file:
                other.unlink()

    def results(self, tasks: Iterable[Task]) -> list[Row]:
        """The results of plant-days that are done."""
        return [json.loads(self.file(task).read_text(encoding="utf-8")) for task in tasks]

    def write_tables(self, day: str, rows: Sequence[Row]) -> None:
        """Flat tables of a day: health, findings and trace. The folder's name contains the day."""
        flat = {
            kind: [{"plant": row["plant"], **part} for row in rows for part in row[kind]]
            for kind in (FINDINGS, TRACE)
        }
        for kind, own in {HEALTH: rows, **flat}.items():
            file = self._folder(kind, day) / f"{kind}.parquet"
            file.parent.mkdir(parents=True, exist_ok=True)
            write_table(file, kind, own)


def _part(key: str, value: str) -> str:
    return f"{key}={quote(value, safe='')}"


def write_table(file: Path, kind: str, rows: Iterable[Row]) -> None:
    """Write rows as a table of a kind, Parquet."""
    import pyarrow.parquet

    types = {"strings": pyarrow.list_(pyarrow.string())}
    fields = [(name, types.get(type_, type_)) for name, type_ in fields_of(kind)]
    table_rows = [{name: row[name] for name, _ in fields} for row in rows]
    buffer = io.BytesIO()
    table = pyarrow.Table.from_pylist(table_rows, schema=pyarrow.schema(fields))
    pyarrow.parquet.write_table(table, buffer)
    write_data(file, buffer.getvalue())


def tables(store: Store, tasks: Sequence[Task], advance: Callable[[int], None]) -> list[Row]:
    """Write the tables of all days; returns the health of all plant-days, by day and plant."""
    days: dict[str, list[Task]] = {}
    for task in tasks:
        days.setdefault(task.day, []).append(task)
    found: list[Row] = []
    for number, (day, own) in enumerate(days.items(), 1):
        rows = store.results(own)
        store.write_tables(day, rows)
        found += [_short(row) for row in rows]
        advance(number)
    return found


def _short(row: Row) -> Row:
    """Health of a plant-day, with its worst finding in words: of the first fault of the worst
    status, the largest."""
    faults = [f for f in row[FINDINGS] if f["text"]]
    first = min(faults, key=lambda f: ("FCSM".find(f["status"]), f["since"]), default=None)
    same = (f for f in faults if first and f["fault"] == first["fault"])
    worst = max(same, key=lambda f: f["degree"] or 0.0, default=None)
    short = {k: v for k, v in row.items() if k not in (FINDINGS, TRACE, POINTS, "notes")}
    count = len(row[FINDINGS])
    return short | {"found": count, "text": worst["text"] if worst else row["reason"]}
