"""Faults that grow over the days of a plant, by the operating points kept of each day.

The days of a plant are judged as one recording: a fault that stays below its threshold on each of
thirty days is reported if all days together show that it grows.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import parse_ruleset
from rulec_runtime.diagnosis.steady.batch_means import Halves
from rulec_runtime.diagnosis.steady.evaluated_points import evaluate_points
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.steady.growing_faults import found_of
from rulec_runtime.diagnosis.steady.growth import Growth
from rulec_runtime.diagnosis.steady.points import Points
from rulec_runtime.fleet.plant_day import POINTS, Row
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.stationary import Timeline, systematic_u
from rulec_runtime.report.growth import grown
from rulec_runtime.report.json_form import growth_form


@dataclass(frozen=True, kw_only=True)
class Trend:
    """A fault of a plant that grows over days: `text` for people, `growth` as JSON data."""

    plant: str
    fault: str
    module: str
    since: str
    text: str
    growth: Mapping[str, Any]


def trends_of(rows: Iterable[Row], rulesets: Mapping[str, str]) -> Iterator[Trend]:
    """Faults that grow in each plant; days of an earlier ruleset are left out."""
    plants: dict[str, list[Row]] = {}
    for row in rows:
        if row[POINTS]:
            plants.setdefault(row["plant"], []).append(row)
    for plant, own in plants.items():
        last = max(own, key=lambda row: str(row["day"]))["ruleset"]
        ruleset = parse_ruleset(json.loads(rulesets[last]))
        if ruleset.dynamics is None:
            points = [point for row in own if row["ruleset"] == last for point in row[POINTS]]
            calendar = Calendar(0.0, ((-np.inf, 0.0),))
            for finding, growth in _growing(ruleset, points):
                yield Trend(
                    plant=plant,
                    fault=finding.fault.id,
                    module=finding.fault.module,
                    since=calendar.iso(finding.since),
                    text=f"{finding.fault.id}: {grown(finding)}",
                    growth=growth_form(finding.fault, growth, calendar),
                )


def _growing(ruleset: Ruleset, means: Sequence[Row]) -> Iterator[tuple[Finding, Growth]]:
    """Faults that grow over operating points, in any order."""
    times = sorted({(p["since"], p["until"], p["samples"]) for p in means})
    index = {since: i for i, (since, _, _) in enumerate(times)}
    names = sorted({p["signal"] for p in means})
    values, u = ({n: np.full(len(times), np.nan) for n in names} for _ in range(2))
    for p in means:
        values[p["signal"]][index[p["since"]]] = p["value"]
        u[p["signal"]][index[p["since"]]] = p["u"]
    since, until, samples = (np.array(column) for column in zip(*times, strict=True))
    signals = ruleset.signal_by_id
    points = Points(
        values=values,
        u=u,
        systematic={n: systematic_u(signals[n], c) + 0.0 * c for n, c in values.items()},
        bad={n: ~np.isfinite(column) for n, column in values.items()},
        why={},
        time=0.5 * (since + until),
    )
    count = len(times)
    timeline = Timeline(since, until, samples, np.arange(count)[::-1], np.zeros(count, dtype=bool))
    halves = Halves(np.zeros((len(ruleset.observers), count)), np.ones(count))
    for part in evaluate_points(ruleset, points, halves, "default"):
        for one in found_of(timeline, ruleset, part).findings:
            if one.growth is not None and one.growth.grows and grown(one):
                yield one, one.growth
