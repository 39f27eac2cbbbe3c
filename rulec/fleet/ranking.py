"""The plants of a fleet, the worst ones first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rulec_runtime.fleet.plant_day import UNREAD, Row
from rulec_runtime.output.plural import plural

ORDER = ("F", "C", "S", "M", UNREAD, "ok")
"""Letters of NE 107 from the worst on; what could not be read stands before what is sound."""


NOT_JUDGED = "not judged"
"""Stands where health is not known."""


@dataclass(frozen=True, kw_only=True)
class Ranked:
    """A plant over the days of a fleet.

    Attributes
    ----------
    status : the worst of its days.
    health : mean share of the time of all faults in which they could be seen and nothing was found;
        None where nothing was judged.
    days, bad, unread, partly : how many days it has, on how many something was found, how many
        could not be judged, and on how many some faults could not be seen.
    worst : day of the worst status, and what was found then.
    text : what was found then, in words.
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
    """Plants in order: those with findings, those of which not all could be seen, the others;
    of each the worst status first, then the least health."""
    plants: dict[str, list[Row]] = {}
    for row in rows:
        plants.setdefault(row["plant"], []).append(row)
    found = [_ranked(plant, own) for plant, own in plants.items()]
    return sorted(found, key=_place)


def _place(one: Ranked) -> tuple[int, int, float, str]:
    group = 0 if one.bad else 1 if one.unread or one.partly else 2
    return group, ORDER.index(one.status), _size(one.health), one.plant


def _size(health: float | None) -> float:
    return 2.0 if health is None else health


def _ranked(plant: str, rows: Sequence[Row]) -> Ranked:
    worst = min(rows, key=lambda r: (ORDER.index(r["status"]), _size(r["health"]), r["day"]))
    known = [row["health"] for row in rows if row["health"] is not None]
    return Ranked(
        plant=plant,
        status=worst["status"],
        health=sum(known) / len(known) if known else None,
        days=len(rows),
        bad=sum(row["status"] in ("F", "S", "M") or row["found"] > 0 for row in rows),
        unread=sum(not row["judged"] for row in rows),
        partly=sum(row["coverage"] is not None and row["coverage"] < 1.0 for row in rows),
        worst=worst["day"],
        text=worst["text"],
    )


def verdict(plants: Sequence[Ranked]) -> str:
    """What there is to say of all of them."""
    count = plural(len(plants), "plant", "plants")
    bad = [one for one in plants if one.bad]
    unread = sum(one.unread > 0 for one in plants)
    partly = sum(one.partly > 0 for one in plants)
    blind = f"; {plural(unread, 'plant has', 'plants have')} days that could not be judged"
    blind = blind * bool(unread)
    if partly:
        blind += f"; {plural(partly, 'is', 'are')} partly blind"
    if not bad:
        return f"Nothing was found in {count}{blind}"
    need = "needs" if len(bad) == 1 else "need"
    worst = f": {bad[0].plant} first"
    return f"{len(bad)} of {count} {need} attention{worst}{blind}"
