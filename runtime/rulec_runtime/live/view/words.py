"""The words and bars for one moment, shared by terminal and page."""

from collections.abc import Iterator
from dataclasses import dataclass

from rulec_runtime.diagnosis.diagnose import worst
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.live.episode import QUIET, Episode, Event, with_times
from rulec_runtime.live.moment import Now
from rulec_runtime.live.view.limits import BAR_ENDS
from rulec_runtime.recordings.plant_calendar import duration, moment
from rulec_runtime.report.blindness import not_judged
from rulec_runtime.report.text import bounds, counted, degree, percent
from rulec_runtime.report.wording import (
    LISTED,
    SHOWN,
    STATUS,
    actions,
    flow_unit,
    headline,
    remarks_of,
    residual_texts,
    titled,
)

NOTHING_YET = ("…", "", "nothing could be judged yet")
"""Replaces the status before anything was judged, which differs from no findings."""

UNKNOWN = "Deviation that nothing known explains"


@dataclass(frozen=True, kw_only=True)
class Card:
    """An active episode in words.

    `size` is the degree with bounds, empty without one. `finding` is that of the diagnosis, for a
    fault.
    """

    episode: Episode
    title: str
    size: str
    meaning: str
    since: str
    probability: str
    others: str
    action: str
    acknowledged: bool
    finding: Finding | None


def cards(now: Now) -> list[Card]:
    """Cards of active episodes: findings first, then blind spots."""
    return [_card(now, episode) for episode in listed(now)]


def listed(now: Now) -> tuple[Episode, ...]:
    """Active episodes in display order."""
    return tuple(sorted(now.active, key=lambda e: e.kind == "blind"))


def finding_of(now: Now, episode: Episode) -> Finding | None:
    """The latest finding of the diagnosis with the fault and time of an episode."""
    if episode.kind != "fault" or now.diagnosis is None:
        return None
    same = (
        f
        for f in now.diagnosis.findings
        if f.fault.id == episode.subject and f.since <= episode.until and episode.since <= f.until
    )
    return max(same, key=lambda f: f.until, default=None)


def _card(now: Now, episode: Episode) -> Card:
    finding, ruleset = finding_of(now, episode), now.ruleset
    faults = ruleset.fault_by_id if ruleset else {}
    title, action = episode.text, episode.action
    if finding is not None and ruleset is not None:
        title, action = headline(ruleset, finding), actions(ruleset, finding)
    elif episode.kind == "unknown":
        title = f"{UNKNOWN}: {episode.text}"
    measured = episode.kind == "fault"
    ends = bounds(episode.lower, episode.upper, episode.unit)
    time = now.time if now.time is not None else episode.until
    began = moment(now.calendar, episode.since, time)  # with the date if on another day
    others = (
        f"{titled(faults[name]) if name in faults else name} ({percent(p)})"
        for name, p in episode.alternatives[:SHOWN]
    )
    return Card(
        episode=episode,
        title=title,
        size=f"{degree(episode.degree, episode.unit)} ({ends})" if measured else "",
        meaning=faults[episode.subject].meaning if episode.subject in faults else "",
        since=f"since {began} ({duration(max(time - episode.since, 0.0))})",
        probability=percent(episode.probability) if measured else "",
        others="; ".join(others),
        action=action,
        acknowledged=episode.id in now.acknowledged,
        finding=finding,
    )


def overall(now: Now) -> tuple[str, str, str]:
    """Symbol, letter and meaning of the overall status."""
    if now.status == "ok" and not now.judged:
        return NOTHING_YET
    symbol, meaning = STATUS[now.status]
    return symbol, now.status, meaning


def lead(now: Now) -> str:
    """The most important thing in one line."""
    if not now.active:
        what = overall(now)[2] if now.judged else NOTHING_YET[2]
        return what[:1].upper() + what[1:]
    episode, faults = listed(now)[0], now.ruleset.fault_by_id if now.ruleset else {}
    title = UNKNOWN if episode.kind == "unknown" else episode.text
    if episode.kind == "fault" and episode.subject in faults:
        title = titled(faults[episode.subject])
    more = len(now.active) - 1
    also = f", and {counted(more, 'other')}" if more else ""
    # The name of a source stays as it is.
    first = title[:1] if episode.kind == "source" else title[:1].upper()
    return first + title[1:] + also


def link(now: Now) -> tuple[str, str]:
    """Symbol and words for the connection."""
    if now.connected:
        return "●", f"connected: {now.source}"
    return "✗", f"NOT CONNECTED: {now.source}"


def latest(now: Now, age: float | None) -> str:
    """The time of the last row, and its `age`, s."""
    if now.time is None:
        return "no row yet"
    ago = f" ({duration(float(int(age)))} ago)" if age is not None else ""
    return f"last row {moment(now.calendar, now.time)}{ago}"


def modules(now: Now) -> Iterator[tuple[str, str, str]]:
    """Name, title and letter of NE 107 of each module."""
    titles = dict(now.ruleset.modules) if now.ruleset else {}
    for name, title in (titles | {e.module: titles.get(e.module, "") for e in now.active}).items():
        if name:
            yield name, title, worst({e.status for e in now.active if e.module == name})


def unjudged(now: Now) -> list[tuple[str, str]]:
    """Remarks on what could not be judged, each with its times; without active ones."""
    if now.diagnosis is None:
        return []
    blind = {episode.text for episode in now.active if episode.kind == "blind"}
    periods = [p for p in not_judged(now.diagnosis) if p.text not in blind]
    return remarks_of(periods, now.calendar)


def unseen(now: Now) -> tuple[str, ...]:
    """Faults that no reading of this plant shows."""
    return now.ruleset.unobserved if now.ruleset else ()


def event_words(now: Now, event: Event) -> tuple[str, str, str, str]:
    """Time, symbol and letter, kind of change, and text of an event."""
    letter = "ok" if event.what in QUIET else event.episode.status
    badge = f"{STATUS[letter][0]} {letter}"
    when = moment(now.calendar, event.time)
    return when, badge, event.what, with_times(event, now.calendar)


def display_state(now: Now) -> tuple[object, ...]:
    """Everything whose change an operator should see at once."""
    latest = now.past[0].number if now.past else 0
    return latest, now.status, now.connected, now.remark, now.acknowledged, len(now.active)


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
    findings = [finding for e in listed(now) if (finding := finding_of(now, e))]
    found = {e.residual: e for finding in reversed(findings) for e in reversed(finding.evidence)}
    title = "Residuals where the findings show most"
    if not found and latest is not None:
        found = {evidence.residual: evidence for evidence in latest.residuals}
        part = "settled stretch" if ruleset.dynamics is None else "windows"
        title = f"Residuals of the last {part}, until {moment(now.calendar, latest.until)}"
    if not found:
        return None
    order, unit = [r.id for r in ruleset.residuals], flow_unit(ruleset)
    order += [name for name in found if name not in order]
    bars, missing = list[Bar](), list[str]()
    for name in sorted(found, key=order.index):
        evidence = found[name]
        if evidence.verdict == "invalid" or evidence.threshold <= 0.0:
            missing.append(name)
            continue
        flow = "" if name in ruleset.signal_by_id else f" {unit.name}"
        value, threshold = (text + flow for text in residual_texts(ruleset, evidence, unit))
        bars.append(Bar(name, value, threshold, abs(evidence.value) / evidence.threshold))
    largest = sorted(bars, key=lambda b: -b.share)[:LISTED]
    shown = tuple(bar for bar in bars if bar in largest)
    return Bars(title, shown, len(bars) - len(shown), tuple(missing))
