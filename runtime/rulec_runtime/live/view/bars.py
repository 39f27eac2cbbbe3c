"""Residuals beside their thresholds, as far as a finding has them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from rulec_runtime.diagnosis.steady.findings import Evidence
from rulec_runtime.live.now import Now
from rulec_runtime.live.view.limits import BAR_ENDS
from rulec_runtime.live.view.words import finding_of, listed
from rulec_runtime.report.wording import LISTED, flow_unit, told_residual


@dataclass(frozen=True)
class Bar:
    """A residual: value and threshold with their unit; `share` is its size in thresholds, NaN
    where it is not available."""

    name: str
    value: str
    threshold: str
    share: float

    @property
    def beyond(self) -> bool:
        """Has it left its threshold?"""
        return self.share > 1.0

    @property
    def words(self) -> str:
        """What the bar shows."""
        if math.isnan(self.share):
            return "not available"
        return f"{self.share:.1f} × {'BEYOND' if self.beyond else 'within'}"

    @property
    def filled(self) -> float:
        """Part of the bar that is filled, 0 to 1."""
        return 0.0 if math.isnan(self.share) else min(self.share / BAR_ENDS, 1.0)


def bars_of(now: Now) -> tuple[Bar, ...]:
    """Residuals where active findings show most, in the ruleset's order; of many the largest."""
    found = list(_bars(now))
    if len(found) > LISTED:
        largest = sorted(found, key=lambda b: (math.isnan(b.share), -b.share))[:LISTED]
        found = [bar for bar in found if bar in largest]
    return tuple(found)


def _bars(now: Now) -> Iterator[Bar]:
    if now.diagnosis is None:
        return
    ruleset = now.diagnosis.ruleset
    seen: dict[str, Evidence] = {}
    for episode in listed(now):
        finding = finding_of(now, episode)
        for evidence in finding.evidence if finding else ():
            seen.setdefault(evidence.residual, evidence)
    order = {name: i for i, name in enumerate(r.id for r in ruleset.residuals)}
    unit = flow_unit(ruleset)
    for name in sorted(seen, key=lambda n: order.get(n, len(order))):
        told = told_residual(ruleset, seen[name], unit)
        flow = "" if name in ruleset.signal_by_id else f" {told.unit}"
        invalid = seen[name].verdict == "invalid" or seen[name].threshold <= 0.0
        share = math.nan if invalid else abs(seen[name].value) / seen[name].threshold
        if invalid:
            yield Bar(name, "–", "–", share)
        else:
            yield Bar(name, told.value + flow, told.threshold + flow, share)
