"""Residuals with their thresholds, also without findings."""

from __future__ import annotations

from dataclasses import dataclass

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady.evidence import Evidence
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.limits import BAR_ENDS
from rulec_runtime.live.view.words import finding_of, listed
from rulec_runtime.recordings.time_text import moment
from rulec_runtime.report.wording import LISTED, flow_unit, told_residual


@dataclass(frozen=True)
class Bar:
    """A residual: value and threshold with their unit; `share` is its size in thresholds."""

    name: str
    value: str
    threshold: str
    share: float

    @property
    def beyond(self) -> bool:
        """Whether it exceeds its threshold."""
        return self.share > 1.0

    @property
    def words(self) -> str:
        """The text of the bar."""
        return f"{self.share:.1f} × threshold"

    @property
    def filled(self) -> float:
        """The filled part of the bar, 0 to 1."""
        return min(self.share / BAR_ENDS, 1.0)


@dataclass(frozen=True)
class Bars:
    """The largest residuals with a title that says of when they are, the number of smaller ones,
    and the names of those that are not available."""

    title: str
    bars: tuple[Bar, ...]
    smaller: int
    missing: tuple[str, ...]


def bars_of(now: Now) -> Bars | None:
    """The residuals of active findings at their clearest, or without findings the latest ones; None
    before anything could be judged."""
    if now.diagnosis is None:
        return None
    ruleset, latest = now.diagnosis.ruleset, now.diagnosis.latest
    found: dict[str, Evidence] = {}
    for episode in listed(now):
        finding = finding_of(now, episode)
        for evidence in finding.evidence if finding else ():
            found.setdefault(evidence.residual, evidence)
    title = "Residuals where the findings show most"
    if not found and latest is not None:
        found = {evidence.residual: evidence for evidence in latest.residuals}
        part = "settled stretch" if ruleset.dynamics is None else "windows"
        title = f"Residuals of the last {part}, until {moment(now.calendar, latest.until)}"
    if not found:
        return None
    order = {r.id: i for i, r in enumerate(ruleset.residuals)}
    ordered = sorted(found.values(), key=lambda e: order.get(e.residual, len(order)))
    usable = [e for e in ordered if e.verdict != "invalid" and e.threshold > 0.0]
    bars = [_bar(ruleset, evidence) for evidence in usable]
    largest = sorted(bars, key=lambda b: -b.share)[:LISTED]
    missing = tuple(e.residual for e in ordered if e not in usable)
    shown = tuple(bar for bar in bars if bar in largest)
    return Bars(title, shown, len(bars) - len(shown), missing)


def _bar(ruleset: Ruleset, evidence: Evidence) -> Bar:
    unit = flow_unit(ruleset)
    value, threshold = told_residual(ruleset, evidence, unit)
    flow = "" if evidence.residual in ruleset.signal_by_id else f" {unit.name}"
    share = abs(evidence.value) / evidence.threshold
    return Bar(evidence.residual, value + flow, threshold + flow, share)
