"""Export a journal as a table or JSON, written while it is read."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from rulec_runtime.live.journal.event_records import Entry, form_for, iso, record_of
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.output.terminal import machine_text, shown, write_machine_text
from rulec_runtime.output.write_file import written

_COLUMNS = (
    *("plant", "number", "iso", "time", "what", "kind", "status", "subject", "module", "text"),
    *("episode", "told", "action", "since", "until", "active", "degree", "lower", "upper", "unit"),
    *("probability", "alternatives", "acknowledged_by", "acknowledged_at"),
)


def csv_pieces(entries: Iterable[Entry]) -> Iterator[str]:
    """A table with a row per event; times in s and UTC, degrees in the unit of the row."""
    yield row_of(_COLUMNS) + "\n"
    for entry in entries:
        record = {"plant": entry.plant, **record_of(entry.event, entry.dated), **_noted(entry)}
        pairs = record["alternatives"]
        record["alternatives"] = "; ".join(f"{name} {_cell(share)}" for name, share in pairs)
        yield row_of(_cell(record[name]) for name in _COLUMNS) + "\n"


def json_pieces(entries: Iterable[Entry]) -> Iterator[str]:
    """``{"events": [...]}`` with an event per line."""
    yield '{"events": ['
    before = "\n"
    for entry in entries:
        form = {**form_for(entry.event, entry.plant, entry.dated), **_noted(entry)}
        yield before + json.dumps(form, ensure_ascii=False, allow_nan=False)
        before = ",\n"
    yield "\n]}\n"


def put(target: str, pieces: Iterable[str]) -> None:
    """Write to a file as a whole, or to standard output (``-``)."""
    if target == "-":
        for piece in pieces:
            write_machine_text(piece)
        return
    with written(Path(target)) as file:
        for piece in pieces:
            file.write(machine_text(piece))


def _noted(entry: Entry) -> dict[str, str | None]:
    at = None if entry.at is None else iso(entry.at)
    return {"acknowledged_by": entry.by, "acknowledged_at": at}


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return shown(" ".join(str(value).splitlines()))
