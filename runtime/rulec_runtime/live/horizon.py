"""The episodes of a diagnosis, and the time that it covers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.live.episode import Episode, Kind
from rulec_runtime.report.blindness import brought_back, told_else, unseen
from rulec_runtime.report.growth import grown
from rulec_runtime.report.json_form import growth_form
from rulec_runtime.report.wording import actions


@dataclass(frozen=True, kw_only=True)
class Horizon:
    """The time that a diagnosis covers, s: from `since` to the last row, and the last settled row.

    `usual` is how long a condition other than a fault must last to be reported, s. `time` are the
    times of the rows, shape (n,); `pause` is the most rows that may interrupt an episode.
    """

    since: float
    until: float
    settled: float
    usual: float
    time: Array
    pause: int

    def rows_between(self, first: float, last: float) -> int:
        """The number of rows after one time and before another."""
        after = np.searchsorted(self.time, first, "right")
        return int(np.searchsorted(self.time, last, "left") - after)


def episodes_of(diagnosis: Diagnosis, horizon: Horizon) -> Iterator[Episode]:
    """All episodes that a diagnosis reports."""
    for finding in diagnosis.findings:
        yield _of_fault(diagnosis.ruleset, finding)
    for sensor in diagnosis.sensors:
        yield Episode(
            id=_id(sensor.id, sensor.since),
            kind="sensor",
            subject=sensor.id,
            module=sensor.module,
            status=sensor.condition.status,
            since=sensor.since,
            until=sensor.until,
            active=sensor.active,
            text=sensor.text,
            action=sensor.condition.action,
            probability=sensor.probability,
        )
    for one in diagnosis.regimes:
        yield Episode(
            id=_id(one.regime.id, one.since),
            kind="regime",
            subject=one.regime.id,
            module=one.regime.module,
            status=one.regime.status,
            since=one.since,
            until=one.until,
            active=one.active,
            text=one.regime.text,
            action=one.regime.action,
        )
    for blind in diagnosis.blind:
        if blind.until - blind.since >= horizon.usual:
            # The readings identify it, whichever faults currently need them.
            yield Episode(
                id=_id("blind", blind.since),
                kind="blind",
                subject=" ".join(blind.readings),
                module="",
                status="C",
                since=blind.since,
                until=blind.until,
                active=blind.active,
                text=f"{unseen(diagnosis.ruleset, blind)}: {blind.because}",
                action=brought_back(blind),
            )
    others: tuple[tuple[Kind, str, tuple[Period, ...]], ...] = (
        ("unknown", "S", diagnosis.unknown),
        ("blind", "C", tuple(p for p in told_else(diagnosis) if not p.partly)),
    )
    for kind, status, periods in others:
        for period in periods:
            active = period.until >= horizon.settled
            until = horizon.until if active else period.until
            if until - period.since >= horizon.usual:
                yield Episode(
                    id=_id(kind, period.since),
                    kind=kind,
                    subject=period.text if kind == "blind" else "",
                    module="",
                    status=status,
                    since=period.since,
                    until=until,
                    active=active,
                    text=period.text,
                )


def _of_fault(ruleset: Ruleset, finding: Finding) -> Episode:
    fault, growth = finding.fault, finding.growth
    return Episode(
        id=_id(fault.id, finding.since),
        kind="fault",
        subject=fault.id,
        module=fault.module,
        status=fault.status,
        since=finding.since,
        until=finding.until,
        active=finding.active,
        text=finding.text,
        action=actions(ruleset, finding),
        degree=finding.degree,
        lower=finding.lower,
        upper=finding.upper,
        unit=fault.unit,
        probability=finding.probability,
        alternatives=finding.alternatives,
        grows=grown(finding),
        rate=0.0 if growth is None or growth.rate is None else growth.rate[0],
        growth={} if growth is None else growth_form(fault, growth, None),
    )


def _id(subject: str, since: float) -> str:
    return f"{subject}@{since:.3f}"
