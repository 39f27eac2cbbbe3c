"""The page of a fleet: its verdict, then a row per plant, the worst ones first."""

from __future__ import annotations

from collections.abc import Sequence

from rulec_runtime.report.document import Head, document, section
from rulec_runtime.report.text import percent, safe

from rulec.fleet.plan import Fleet
from rulec.fleet.ranking import Ranked, verdict

TITLES = ("plant", "status", "health", "days", "with findings", "not judged", "worst day", "what")
NUMBERS = 6
"""Columns from the third to the sixth hold numbers."""


def fleet_page(fleet: Fleet, plants: Sequence[Ranked], days: Sequence[str]) -> str:
    """The ranking as HTML; the same results give the same text."""
    head = "".join(f"<th{_number(i)}>{title}</th>" for i, title in enumerate(TITLES))
    body = "".join(_row(one) for one in plants)
    table = (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
        '</div><p class="soft">Status by NE 107: F failure, C function check, S out of '
        "specification, M maintenance. Health is the share of a day that no finding covers, as the "
        "mean of all days.</p>"
    )
    about = [
        ("Fleet", f"{fleet.name}: {fleet.title}"),
        ("Days", f"{days[0]} to {days[-1]} ({len(days)})" if days else "none"),
        ("Recordings", fleet.recordings.rsplit("/", 1)[-1]),
        ("Rulesets", ", ".join(sorted(fleet.rulesets))),
    ]
    found = Head(kind="Fleet", verdict=verdict(plants), facts=about)
    return document(found, section("Plants, the worst first", table))


def _row(one: Ranked) -> str:
    health = "–" if one.health is None else percent(one.health)
    cells = (one.plant, one.status, health, *map(str, (one.days, one.bad, one.unread)))
    shown = (*cells, one.worst, one.text)
    return f"<tr>{''.join(f'<td{_number(i)}>{safe(s)}</td>' for i, s in enumerate(shown))}</tr>"


def _number(column: int) -> str:
    return ' class="num"' if 2 <= column < NUMBERS else ""
