"""The plants of a fleet, the worst first; and their page: the verdict, then a row per plant."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rulec_runtime.fleet.plant_day import UNREAD, Row
from rulec_runtime.output.plural import plural
from rulec_runtime.report.document import Head, document
from rulec_runtime.report.parts import Cell, Facts, Part, Table, Words
from rulec_runtime.report.text import percent

from rulec.fleet.fleet_file import Fleet
from rulec.fleet.trends import Trend

ORDER = ("F", "C", "S", "M", UNREAD, "ok")
"""Letters of NE 107, the worst first; unreadable days rank before sound ones."""

NOT_JUDGED = "not judged"
"""Shown if health is not known."""


@dataclass(frozen=True, kw_only=True)
class Ranked:
    """A plant over the days of a fleet.

    Attributes
    ----------
    status : the worst of its days.
    health : mean share of the time of all faults in which they were detectable and nothing was
        found; None if nothing was judged.
    days, bad, unread, partly : numbers of all days, of those with findings, of those that could not
        be judged, and of those on which some faults were not detectable.
    worst : day of the worst status.
    text : what was found on that day, in words.
    """

    plant: str
    status: str
    health: float | None
    days: int
    bad: int
    unread: int
    partly: int
    worst: str
    text: str


def ranked(rows: Iterable[Row]) -> list[Ranked]:
    """Plants in order: those with findings, those that were not fully judged, the others; in each
    group the worst status first, then the lowest health."""
    plants: dict[str, list[Row]] = {}
    for row in rows:
        plants.setdefault(row["plant"], []).append(row)

    def place(one: Ranked) -> tuple[int, int, float, str]:
        group = 0 if one.bad else 1 if one.unread or one.partly else 2
        return group, ORDER.index(one.status), _size(one.health), one.plant

    return sorted((_ranked(plant, own) for plant, own in plants.items()), key=place)


def _size(health: float | None) -> float:
    return 2.0 if health is None else health


def _ranked(plant: str, rows: Sequence[Row]) -> Ranked:
    worst = min(rows, key=lambda r: (ORDER.index(r["status"]), _size(r["health"]), r["day"]))
    healths = [row["health"] for row in rows if row["health"] is not None]
    return Ranked(
        plant=plant,
        status=worst["status"],
        health=sum(healths) / len(healths) if healths else None,
        days=len(rows),
        bad=sum(row["status"] in ("F", "S", "M") or row["found"] > 0 for row in rows),
        unread=sum(not row["judged"] for row in rows),
        partly=sum(row["coverage"] is not None and row["coverage"] < 1.0 for row in rows),
        worst=worst["day"],
        text=worst["text"],
    )


def verdict(plants: Sequence[Ranked]) -> str:
    """The result for all plants in a sentence."""
    count = plural(len(plants), "plant", "plants")
    bad = [one for one in plants if one.bad]
    unread = sum(one.unread > 0 for one in plants)
    partly = sum(one.partly > 0 for one in plants)
    blind = ""
    if unread:
        blind = f"; {plural(unread, 'plant has', 'plants have')} days that could not be judged"
    if partly:
        blind += f"; {plural(partly, 'is', 'are')} partly blind"
    if not bad:
        return f"Nothing was found in {count}{blind}"
    need = "needs" if len(bad) == 1 else "need"
    return (
        f"{len(bad)} of {count} {need} attention: {bad[0].plant}{' first' * (len(bad) > 1)}{blind}"
    )


TITLES = ("plant", "status", ".health", ".days", ".with findings", ".not judged",
          ".partly blind", "worst day", "what")  # fmt: skip

LEGEND = (
    "Status by NE 107: F failure, C function check, S out of specification, M maintenance. Health "
    "is the share of the time of all faults in which they could be seen and nothing was found, as "
    "the mean of the days that were judged."
)


def fleet_page(
    fleet: Fleet, plants: Sequence[Ranked], days: Sequence[str], trends: Sequence[Trend] = ()
) -> str:
    """The ranking as HTML; the same results give the same text."""
    shown = Table(TITLES, list(map(_cells, plants)), "plants")
    about = [
        ("Fleet", f"{fleet.name}: {fleet.title}"),
        ("Days", f"{days[0]} to {days[-1]} ({len(days)})" if days else "none"),
        ("Recordings", fleet.recordings.rsplit("/", 1)[-1]),
        ("Rulesets", ", ".join(sorted(fleet.rulesets))),
    ]
    found = Head(kind="Fleet", verdict=verdict(plants), facts=about)
    parts = [Part("Plants, the worst first", [shown, Words(LEGEND, soft=True)])]
    if trends:
        rows = [(one.plant, [one.text]) for one in trends]
        parts.append(Part("What grows over the days", [Facts(rows)]))
    return document(found, parts)


def _cells(one: Ranked) -> list[Cell]:
    """The row of a plant; one that was not judged is grey, neither sound nor faulty."""
    health = NOT_JUDGED if one.health is None else percent(one.health)
    counts = map(str, (one.days, one.bad, one.unread, one.partly))
    shown = (one.plant, one.status, health, *counts, one.worst, one.text)
    return [Cell(text, "soft" if one.health is None else "") for text in shown]
