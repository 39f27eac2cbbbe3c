"""The page of a fleet: its verdict, then a row per plant, the worst first."""

from __future__ import annotations

from collections.abc import Sequence

from rulec_runtime.report.document import Head, document, section
from rulec_runtime.report.text import percent, safe

from rulec.fleet.fleet_file import Fleet
from rulec.fleet.ranking import NOT_JUDGED, Ranked, verdict
from rulec.fleet.trends import Trend

TITLES = ("plant", "status", "health", "days", "with findings", "not judged",
          "partly blind", "worst day", "what")  # fmt: skip


def fleet_page(
    fleet: Fleet, plants: Sequence[Ranked], days: Sequence[str], trends: Sequence[Trend] = ()
) -> str:
    """The ranking as HTML; the same results give the same text."""
    head = "".join(f"<th{_number(i)}>{title}</th>" for i, title in enumerate(TITLES))
    body = "".join(_row(one) for one in plants)
    table = (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
        '</div><p class="soft">Status by NE 107: F failure, C function check, S out of '
        "specification, M maintenance. Health is the share of the time of all faults in which "
        "they could be seen and nothing was found, as the mean of the days that were judged.</p>"
    )
    about = [
        ("Fleet", f"{fleet.name}: {fleet.title}"),
        ("Days", f"{days[0]} to {days[-1]} ({len(days)})" if days else "none"),
        ("Recordings", fleet.recordings.rsplit("/", 1)[-1]),
        ("Rulesets", ", ".join(sorted(fleet.rulesets))),
    ]
    found = Head(kind="Fleet", verdict=verdict(plants), facts=about)
    parts = [section("Plants, the worst first", table)]
    if trends:
        rows = "".join(f"<dt>{safe(one.plant)}</dt><dd>{safe(one.text)}</dd>" for one in trends)
        parts.append(section("What grows over the days", f"<dl>{rows}</dl>"))
    return document(found, "".join(parts))


def _row(one: Ranked) -> str:
    health = NOT_JUDGED if one.health is None else percent(one.health)
    counts = map(str, (one.days, one.bad, one.unread, one.partly))
    shown = (one.plant, one.status, health, *counts, one.worst, one.text)
    # A plant that was not judged is neither sound nor faulty.
    grey = ' class="soft"' if one.health is None else ""
    cells = "".join(f"<td{_number(i)}>{safe(s)}</td>" for i, s in enumerate(shown))
    return f"<tr{grey}>{cells}</tr>"


def _number(column: int) -> str:
    return ' class="num"' if 2 <= column < 7 else ""  # from health to partly blind
