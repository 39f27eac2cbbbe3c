"""The episodes of a diagnosis, and their changes to the next: what began, grew or ended.

Each diagnosis reports a fault anew, perhaps in parts or under another name now that more is known.
An episode is what an operator would call one and the same event.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rulec_runtime.contract.degree import degree_in_figures
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.diagnosis.steady.growth import next_level
from rulec_runtime.diagnosis.stores.windows import rows_of_a_finding
from rulec_runtime.limits import HEADLINE_RIVAL, SETTLING
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Episode, Event, Kind, What
from rulec_runtime.report.blindness import brought_back, not_judged, unseen
from rulec_runtime.report.growth import grown
from rulec_runtime.report.json_form import growth_form
from rulec_runtime.report.wording import actions

AT_LENGTH: tuple[Kind, ...] = ("blind", "unknown")
"""Kinds of episodes that must last to be reported."""


@dataclass(frozen=True)
class Horizon:
    """Times of the rows that a diagnosis covers, s, shape (n,), and of the last settled row."""

    time: Array
    settled: float

    @property
    def since(self) -> float:
        """Time of the first row, s."""
        return float(self.time[0])

    @property
    def until(self) -> float:
        """Time of the last row, s."""
        return float(self.time[-1])

    @property
    def usual(self) -> float:
        """How long a condition other than a fault must last to be reported, s."""
        interval = float(np.median(np.diff(self.time))) if len(self.time) > 1 else np.inf
        return limits.BLIND_ROWS * interval

    def rows_between(self, first: float, last: float) -> int:
        """The number of rows after one time and before another."""
        after = np.searchsorted(self.time, first, "right")
        return int(np.searchsorted(self.time, last, "left") - after)


def episodes_of(diagnosis: Diagnosis, horizon: Horizon) -> Iterator[Episode]:
    """All episodes that a diagnosis reports."""
    for finding in diagnosis.findings:
        yield _of_fault(diagnosis.ruleset, finding)
    for sensor in diagnosis.sensors:
        own, span = sensor.condition, (sensor.since, sensor.until, sensor.active)
        one = _episode("sensor", sensor.id, span, own.status, sensor.text, action=own.action)
        yield replace(one, module=sensor.module, probability=sensor.probability)
    for found in diagnosis.regimes:
        regime, span = found.regime, (found.since, found.until, found.active)
        one = _episode("regime", regime.id, span, regime.status, regime.text, action=regime.action)
        yield replace(one, module=regime.module)
    for blind in diagnosis.blind:
        # The readings identify it, whichever faults currently need them.
        readings, span = " ".join(blind.readings), (blind.since, blind.until, blind.active)
        text = f"{unseen(diagnosis.ruleset, blind)}: {blind.because}"
        action = brought_back(blind)
        yield _episode("blind", readings, span, "C", text, action=action, name="blind")
    others: tuple[tuple[Kind, str, Iterable[Period]], ...] = (
        ("unknown", "S", diagnosis.unknown),
        ("blind", "C", (p for p in not_judged(diagnosis) if not (p.partly or p.rests))),
    )
    for kind, status, periods in others:
        for period in periods:
            active = period.until >= horizon.settled
            span = (period.since, horizon.until if active else period.until, active)
            # Nothing is judged meanwhile; why may change from sample to sample.
            yield _episode(kind, "", span, status, period.text, name=kind)


def _episode(
    kind: Kind,
    subject: str,
    span: tuple[float, float, bool],
    status: str,
    text: str,
    *,
    name: str = "",
    **other: Any,
) -> Episode:
    """An episode; `span` is when it began, its last time, and whether it lasts. `name` is what its
    id begins with, if not with its subject."""
    own = {"kind": kind, "subject": subject, "status": status, "text": text, "module": "", **other}
    own |= zip(("since", "until", "active"), span, strict=True)
    return Episode(id=f"{name or subject}@{span[0]:.3f}", **own)


def _of_fault(ruleset: Ruleset, finding: Finding) -> Episode:
    fault, growth = finding.fault, finding.growth
    names = ("degree", "lower", "upper", "probability", "alternatives")
    return _episode(
        "fault",
        fault.id,
        (finding.since, finding.until, finding.active),
        fault.status,
        finding.text,
        module=fault.module,
        action=actions(ruleset, finding),
        unit=fault.unit,
        grows=grown(finding),
        rate=0.0 if growth is None or growth.rate is None else growth.rate[0],
        growth={} if growth is None else growth_form(fault, growth, None),
        **{name: getattr(finding, name) for name in names},
    )


def changes(
    ruleset: Ruleset, before: Sequence[Episode], diagnosis: Diagnosis, horizon: Horizon, number: int
) -> tuple[tuple[Episode, ...], tuple[Event, ...]]:
    """The current episodes, and events for what is new.

    `before` are earlier episodes, active or within the horizon; `number` is that of the last event.
    """
    merged = _merged(episodes_of(diagnosis, horizon), horizon)
    found = every = [one for one in merged if one.kind not in AT_LENGTH or _lasts(one, horizon)]
    # Windows move with every row, so what a few rows of a plant that stores show may fluctuate.
    wait = 0 if ruleset.dynamics is None else rows_of_a_finding(len(horizon.time))
    events, current = list[Event](), list[Episode]()

    def report(what: What, old: Episode, now: Episode) -> None:
        text, next_one = _words(ruleset, what, old, now), number + 1 + len(events)
        events.append(Event(number=next_one, time=horizon.until, what=what, text=text, episode=now))

    for old in before:
        mine = [one for one in found if _same(old, one, horizon)]
        if old.kind == "source" or (not mine and _may_return(old, before, found, horizon, wait)):
            current.append(old)
            continue
        found = [one for one in found if one not in mine]
        now = replace(mine[-1] if mine else replace(old, active=False), id=old.id, told=old.told)
        now = replace(now, since=min([old.since, *(e.since for e in mine)]))
        if now.active and not old.active and horizon.rows_between(old.until, now.until) < wait:
            now = old
        refuted = not wait and not any(_same(old, one, horizon) for one in every)
        what = _what(old, now, bool(mine), horizon, refuted)
        if what is None and not wait and _was_earlier(old, now, horizon):
            what = "changed"
        if what == "withdrawn":
            report(what, old, now)
            continue
        if what is not None:
            now = replace(now, told=(now.until, now.degree))
            report(what, old, now)
        current.append(now)
    for new in (replace(one, told=(one.until, one.degree)) for one in found):
        if not new.active and new.until < horizon.since:
            continue  # only operating points in memory still show what was reported long ago
        current.append(new)
        report("began", new, new)
        if not new.active:
            report("ended", new, new)
    current = [one for one in current if one.active or one.until >= horizon.since]
    return tuple(current), tuple(events)


def _merged(episodes: Iterable[Episode], horizon: Horizon) -> list[Episode]:
    """One episode for all of the same subject that overlap or follow each other, with the content
    of the latest."""
    found: list[Episode] = []
    for one in episodes:
        for i, first in enumerate(found):
            if _of_one_subject(first, one) and (
                _at_one_time(first, one) or _goes_on(first, one, horizon)
            ):
                found[i] = replace(
                    one if one.until >= first.until else first,
                    since=min(first.since, one.since),
                    until=max(first.until, one.until),
                    active=first.active or one.active,
                )
                break
        else:
            found.append(one)
    return found


def _lasts(one: Episode, horizon: Horizon) -> bool:
    return one.until - one.since >= horizon.usual


def _of_one_subject(one: Episode, other: Episode) -> bool:
    return one.kind == other.kind and one.subject == other.subject


def _at_one_time(one: Episode, other: Episode) -> bool:
    return one.since <= other.until and other.since <= one.until


def _same(old: Episode, new: Episode, horizon: Horizon) -> bool:
    """Whether both are the same episode. A fault may since have got the name of an alternative that
    fitted about as well."""
    if old.kind != new.kind:
        return False
    if _at_one_time(old, new):
        names = {old.subject, *(name for name, _ in old.alternatives)}
        others = {new.subject, *(name for name, _ in new.alternatives)}
        return bool(names & others)
    return _of_one_subject(old, new) and old.active and _goes_on(old, new, horizon)


def _goes_on(first: Episode, second: Episode, horizon: Horizon) -> bool:
    """Whether the second follows the first with hardly any rows between them."""
    between = horizon.rows_between(first.until, second.since)
    return first.until < second.since and between <= SETTLING


def _may_return(
    old: Episode, before: Sequence[Episode], found: Sequence[Episode], horizon: Horizon, wait: int
) -> bool:
    """Whether it is too early to end an episode. That takes as many rows as beginning one, unless a
    new fault explains the same rows."""
    if not old.active or old.kind not in ("fault", "unknown"):
        return False
    for one in found:
        new = not any(_same(other, one, horizon) for other in before)
        if new and one.kind == "fault" and _at_one_time(old, one):
            return False
    return horizon.rows_between(old.until, horizon.until) < wait


def _was_earlier(old: Episode, now: Episode, horizon: Horizon) -> bool:
    """Whether a fault that has ended began long before the reported time."""
    ended = old.kind == "fault" and not old.active and not now.active
    return ended and horizon.rows_between(now.since, old.since) > SETTLING


def _what(old: Episode, now: Episode, found: bool, horizon: Horizon, refuted: bool) -> What | None:
    """What is new about an episode; None if an operator need not know. A fault that is not found
    any more, although the horizon still covers it from its beginning, was none."""
    was_none = old.kind == "fault" and old.since >= horizon.since
    if old.active and not now.active:
        return "withdrawn" if was_none and not found else "ended"
    if not old.active:
        if was_none and refuted:
            return "withdrawn"
        return "began" if found and now.active else None
    renamed = now.subject != old.subject
    return "changed" if renamed or _has_grown(now) or _rivals(now) != _rivals(old) else None


def _has_grown(episode: Episode) -> bool:
    """Whether the degree differs from the last report by more than its bounds, and also from its
    expected growth or has passed a round number."""
    if episode.told is None or episode.kind != "fault":
        return False
    time, degree = episode.told
    half = max(episode.upper - episode.degree, episode.degree - episode.lower)
    expected = degree + episode.rate * (episode.until - time)
    if not abs(episode.degree - degree) > half > 0.0:
        return False
    passed = next_level(max(degree, half)) != next_level(max(episode.degree, half))
    return passed or abs(episode.degree - expected) > half


def _rivals(episode: Episode) -> set[str]:
    """Alternatives that an operator should consider at once."""
    return {name for name, p in episode.alternatives if p >= HEADLINE_RIVAL}


def _words(ruleset: Ruleset, what: What, old: Episode, now: Episode) -> str:
    if now.kind != "fault":
        name = now.subject if now.kind in ("sensor", "regime") else ""
        if what in ("ended", "withdrawn"):
            again = {"sensor": "healthy again", "blind": "judged again"}.get(now.kind, "over")
            return f"{name} {again}; it was: {now.text}".strip()
        return now.text
    fault = ruleset.fault_by_id[now.subject]
    degree, low, high = (degree_in_figures(fault, x) for x in (now.degree, now.lower, now.upper))
    size = f"{now.subject} {degree} ({low} to {high})"
    if what == "withdrawn":
        return f"{now.subject}: later readings do not confirm it"
    if what == "ended":
        return size
    if what == "changed" and not now.active:
        return f"{size} has ended, and began earlier than reported"
    rivals = ", ".join(sorted(_rivals(now)))
    also = f"; also possible: {rivals}" if rivals else ""
    if what == "changed" and now.subject != old.subject:
        return f"{size}, reported as {old.subject} before{also}"
    return f"{size}{also}" + (f"; {now.grows}" if now.grows else "")
