"""A journal for people, active episodes first, then events, newest first; or as a table or JSON,
written while it is read."""

import json
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.padding import Padding
from rich.table import Table

from rulec_runtime.live.episode import QUIET
from rulec_runtime.live.journal.event_records import Entry, form_for, iso, record_of
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.output.terminal import machine_text, one_line, shown, styled, write_machine_text
from rulec_runtime.output.write_file import written
from rulec_runtime.report.text import degree
from rulec_runtime.report.wording import STATUS


def tell(out: Console, active: Sequence[Entry], past: Sequence[Entry], several: bool) -> None:
    """Print the table; with `several` plants each line names its plant."""
    worst = next((s for s in STATUS if any(e.event.episode.status == s for e in active)), "ok")
    symbol, meaning = STATUS[worst]
    if active:
        count = f"{len(active)} active" if len(active) > 1 else "one active"
        out.print(styled("[bold]{} {} {}[/]: {}", symbol, worst, meaning, count))
    else:
        out.print(styled("[bold]{} no active findings[/]", symbol))
    for entry in sorted(active, key=_rank):
        _active(out, entry, several)
    if past:
        _events(out, past, several)
    noted = {(e.plant, e.event.episode.id): e for e in (*past, *active) if e.by is not None}
    if noted:
        _acknowledged(out, list(noted.values()), several)


def _events(out: Console, past: Sequence[Entry], several: bool) -> None:
    zone = "times in UTC" if past[-1].iso is not None else "times in s"
    out.print(styled("\n[bold]Events[/], newest first [dim]({})[/]", zone))
    table = Table.grid(padding=(0, 2))
    table.add_column(no_wrap=True, justify="right")
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    day = ""
    for entry in reversed(past):
        date, clock = _moment(entry, entry.event.time)
        if date != day:
            day = date
            table.add_row(styled("[dim]{}[/]", date))
        event = entry.event
        table.add_row(clock, _letter(entry), event.what, _named(entry, several, event.text))
    out.print(table)


def _acknowledged(out: Console, noted: Sequence[Entry], several: bool) -> None:
    out.print(styled("\n[bold]Acknowledged[/], newest first [dim](times in UTC)[/]"))
    for entry in sorted(noted, key=lambda e: -(e.at or 0.0)):
        one = entry.event.episode
        since = " ".join(filter(None, _moment(entry, one.since)))
        name = _named(entry, several, one.subject or one.kind)
        out.print(Padding(styled("{}: {} since {}", _by(entry), name, since), (0, 0, 0, 2)))


def _by(entry: Entry) -> str:
    date = None if entry.at is None else iso(entry.at)
    return f"{entry.by}, {date[:19].replace('T', ' ')} UTC" if date else f"{entry.by}"


def _rank(entry: Entry) -> tuple[int, float]:
    order = [s for s in STATUS if s != "ok"]
    status = entry.event.episode.status
    return (order.index(status) if status in order else len(order), entry.event.episode.since)


def _active(out: Console, entry: Entry, several: bool) -> None:
    episode = entry.event.episode
    size = ""
    if episode.kind == "fault":
        low, high = (degree(x, episode.unit) for x in (episode.lower, episode.upper))
        size = f" {degree(episode.degree, episode.unit)} ({low} to {high})"
    since = " ".join(filter(None, _moment(entry, episode.since)))
    name = _named(entry, several, f"{episode.subject or episode.kind}{size}")
    out.print(styled("{}  [bold]{}[/] since {}", _letter(entry), name, since))
    lines = [(episode.text, "{}")]
    if episode.action:
        lines.append((episode.action, "do: {}"))
    if episode.alternatives:
        others = ", ".join(f"{name} ({100 * share:.0f} %)" for name, share in episode.alternatives)
        lines.append((others, "also possible: {}"))
    if entry.by is not None:
        lines.append((_by(entry), "acknowledged by {}"))
    lines.append((episode.id, "[dim]{}[/]"))
    for text, template in lines:
        out.print(Padding(styled(template, text), (0, 0, 0, 5)))


def _letter(entry: Entry) -> str:
    event = entry.event
    status = "ok" if event.what in QUIET else one_line(event.episode.status)
    return f"{STATUS[status][0]} {status}" if status in STATUS else f"? {status}"


def _named(entry: Entry, several: bool, text: str) -> str:
    return one_line(f"{entry.plant}: {text}" if several else text)


def _moment(entry: Entry, time: float) -> tuple[str, str]:
    """Date, empty without dates, and time of day."""
    if entry.iso is not None:
        try:
            date = datetime.fromtimestamp(time, UTC)
            return f"{date:%Y-%m-%d}", f"{date:%H:%M:%S}"
        except (ValueError, OverflowError, OSError):
            pass
    return "", f"{time:g} s"


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
