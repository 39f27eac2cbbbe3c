"""What a diagnosis sees: episodes that it tells of, and how far it looks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.blind import Blind
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.live.episode import Episode, Kind
from rulec_runtime.report.blindness import brought_back, told_else, unseen
from rulec_runtime.report.growth import grown
from rulec_runtime.report.json_form import growth_form
from rulec_runtime.report.wording import actions


@dataclass(frozen=True, kw_only=True)
class Horizon:
    """How far a diagnosis looks, s: since when, until which row, and until which settled one;
    `usual` is how long something that is no fault lasts before it is told. `time` are those of the
    rows, shape (n,); `pause` is in how many rows nothing may be seen of an episode that goes on."""

    since: float
    until: float
    settled: float
    usual: float
    time: Array
    pause: int

    def rows_between(self, first: float, last: float) -> int:
        """Rows later than one time and before another. While there are none, nothing ends."""
        after = np.searchsorted(self.time, first, "right")
        return int(np.searchsorted(self.time, last, "left") - after)


def episodes_of(diagnosis: Diagnosis, sight: Horizon) -> Iterator[Episode]:
    """All that a diagnosis tells and that lasts."""
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
        if blind.until - blind.since >= sight.usual:
            yield _of_blind(diagnosis.ruleset, blind)
    others: tuple[tuple[Kind, str, tuple[Period, ...]], ...] = (
        ("unknown", "S", diagnosis.unknown),
        ("blind", "C", tuple(p for p in told_else(diagnosis) if not p.partly)),
    )
    for kind, status, periods in others:
        for period in periods:
            active = period.until >= sight.settled
            until = sight.until if active else period.until
            if until - period.since >= sight.usual:
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


def _of_blind(ruleset: Ruleset, blind: Blind) -> Episode:
    """Of the same readings it is one and the same, whichever faults they are needed for by now."""
    return Episode(
        id=_id("blind", blind.since),
        kind="blind",
        subject=" ".join(blind.readings),
        module="",
        status="C",
        since=blind.since,
        until=blind.until,
        active=blind.active,
        text=f"{unseen(ruleset, blind)}: {blind.because}",
        action=brought_back(blind),
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
