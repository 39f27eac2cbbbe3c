"""A journal for people, active episodes first, then events, newest first; or as a table or JSON."""

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

from rich.console import Console
from rich.padding import Padding
from rich.table import Table

from rulec_runtime.live.episode import QUIET, with_times
from rulec_runtime.live.journal.event_records import UTC as BY_UTC
from rulec_runtime.live.journal.event_records import Entry, form_for, iso, record_of
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.output.terminal import one_line, shown, styled
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
        text = with_times(entry.event, BY_UTC if entry.dated else None)
        table.add_row(clock, _letter(entry), entry.event.what, _named(entry, several, text))
    out.print(table)


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


def csv_of(entries: Iterable[Entry]) -> str:
    """A table with a row per event; times in s and UTC, degrees in the unit of the row."""
    lines = [row_of(_COLUMNS)]
    for entry in entries:
        record = {"plant": entry.plant, **record_of(entry.event, entry.dated), **_noted(entry)}
        pairs = record["alternatives"]
        record["alternatives"] = "; ".join(f"{name} {_cell(share)}" for name, share in pairs)
        lines.append(row_of(_cell(record[name]) for name in _COLUMNS))
    return "\n".join(lines) + "\n"


def json_of(entries: Iterable[Entry]) -> dict[str, Any]:
    """The events as JSON data."""
    forms = ({**form_for(e.event, e.plant, e.dated), **_noted(e)} for e in entries)
    return {"events": list(forms)}


def _noted(entry: Entry) -> dict[str, str | None]:
    at = None if entry.at is None else iso(entry.at)
    return {"acknowledged_by": entry.by, "acknowledged_at": at}


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    return shown(" ".join(str(value).splitlines()))
