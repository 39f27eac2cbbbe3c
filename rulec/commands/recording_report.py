"""What `rulec check` reports about a recording: on the terminal, and as JSON data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.plant_calendar import duration

from rulec.commands.recording_facts import Facts, Lack, Reading

_WHOLE, _PART = "[green]✓[/] {}: {} of {}", "[yellow]![/] {}: {} of {}"

SHOWN = 4
"""Names shown from a list; the others are counted."""


def tell(out: Console, name: str, facts: Facts) -> None:
    """Print the columns, what can run, how much is settled, and what a mismatch could find."""
    out.print(
        styled("{}: {} over {}", name, plural(facts.rows, "row", "rows"), duration(facts.seconds))
    )
    out.print(_columns(facts.readings))
    for line in _lines(facts):
        out.print(line)


def json_form(facts: Facts) -> dict[str, Any]:
    """All facts as JSON data; missing readings are null."""
    data = asdict(facts)
    for part in data["readings"]:
        for key in ("low", "middle", "high"):
            part[key] = part[key] if math.isfinite(part[key]) else None
    return data


def _columns(readings: Sequence[Reading]) -> Table:
    table = Table(box=None, pad_edge=False)
    for title in ("", "signal", "column", "lowest", "median", "highest", ""):
        number = title in ("lowest", "median", "highest")
        table.add_column(title, justify="right" if number else "left")
    for one in readings:
        if not one.title and not one.used:
            continue  # nothing reads it
        shown = [f"{v:.4g}" if math.isfinite(v) else "" for v in (one.low, one.middle, one.high)]
        cells = [one.signal, one.title or "-", *shown, _remark(one)]
        mark = "[red]-[/]" if not one.title else "[yellow]![/]" if one.odd else "[green]✓[/]"
        table.add_row(styled(mark), *map(Text, cells))
    return table


def _remark(one: Reading) -> str:
    if not one.title:
        return "not in the recording"
    return "; ".join(one.odd) or one.unit + ("" if one.used else ", read by no equation")


def _lines(facts: Facts) -> Iterator[Text]:
    # If a column is missing, the reader of the recording already names the strangers.
    if facts.strangers and not any(one.used and not one.title for one in facts.readings):
        yield styled("columns that belong to no signal: {}", _some(facts.strangers))
    for note in facts.notes:
        yield styled("[dim]note: {}[/]", note)
    if facts.settled is None:
        yield Text("the plant has storage: it is judged while it moves, not only when settled")
    else:
        stretches = plural(facts.stretches, "stretch", "stretches")
        yield styled("settled: {} % of the rows, in {}", f"{100 * facts.settled:.0f}", stretches)
    for what, (count, every) in (
        ("flow estimates available", facts.estimates),
        ("comparisons between them", facts.comparisons),
        ("detectable faults", facts.faults),
    ):
        template = _WHOLE if count == every else _PART
        yield styled(template, what, count, every)
    if facts.blind:
        yield styled("  undetectable: {}", _some(facts.blind))
    for lack in facts.lacks:
        yield styled("  without {} ({}): {}", lack.signal, lack.why, _without(lack))
    yield styled(
        "this recording could reveal {} of {} known effects (`rulec show effects PLANT`)",
        *facts.effects,
    )
    for quantity, names in facts.unread.items():
        yield styled("  with a sensor for {} also: {}", quantity, _some(names))


def _without(lack: Lack) -> str:
    parts = []
    if lack.estimates:
        parts.append(f"no {_some(lack.estimates)}")
    if lack.comparisons:
        parts.append(plural(len(lack.comparisons), "fewer comparison", "fewer comparisons"))
    if lack.effects:
        parts.append(f"mismatch cannot find {_some(lack.effects)}")
    return "; ".join(parts) or "its balance cannot be followed"


def _some(names: Sequence[str]) -> str:
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return ", ".join(names[:SHOWN]) + more
