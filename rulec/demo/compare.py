"""Comparison of the faults in the journal with the planted ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table
from rulec_runtime.live.episode import Event
from rulec_runtime.output.terminal import styled

from rulec.simulation.prediction import Injected


@dataclass(frozen=True)
class Match:
    """A planted fault, and the events that report it."""

    planted: Injected
    events: tuple[Event, ...]


def matched(
    planted: Sequence[Injected], events: Sequence[Event]
) -> tuple[list[Match], list[Event]]:
    """Each planted fault with the events of its name that overlap it, and the beginnings of all
    faults that nobody planted. Times are of one clock, s."""
    lasting = [e for e in events if e.episode.kind in ("fault", "sensor", "unknown")]
    taken: set[str] = set()
    matches = []
    for fault in planted:
        own = [
            e
            for e in lasting
            if e.episode.subject == fault.fault
            and e.episode.since <= fault.until
            and fault.since <= e.episode.until
        ]
        taken |= {e.episode.id for e in own}
        matches.append(Match(fault, tuple(own)))
    others = [e for e in lasting if e.what == "began" and e.episode.id not in taken]
    return matches, others


def tell(out: Console, matches: Sequence[Match], others: Sequence[Event], began: float) -> None:
    """Print the comparison; times in s since `began`."""
    table = Table(box=None, pad_edge=False)
    table.add_column("")
    titles = ("planted", "degree", "from", "to", "told after", "as", "95 % bounds", "over after")
    for title in titles:
        table.add_column(title, justify="left" if title == "planted" else "right", no_wrap=True)
    for match in matches:
        fault = match.planted
        row = [
            fault.fault,
            f"{fault.degree:g}",
            *(f"{t - began:.1f} s" for t in (fault.since, fault.until)),
        ]
        if not match.events:
            table.add_row(styled("[bold]✗[/]"), *row, "not told", "", "", "")
            continue
        last = match.events[-1]
        over = f"{last.time - fault.until:.1f} s" if last.what == "ended" else "active"
        one = last.episode
        table.add_row(
            "✓",
            *row,
            f"{match.events[0].time - fault.since:.1f} s",
            f"{one.degree:.3f}",
            f"{one.lower:.3f}-{one.upper:.3f}",
            over,
        )
    out.print(table)
    count = sum(1 for match in matches if match.events)
    text = "{} of {} planted faults found, {} told that nobody planted"
    out.print(styled(text, count, len(matches), len(others)))
    for event in others:
        out.print(styled("  {} s  {}", f"{event.time - began:.1f}", event.text))
