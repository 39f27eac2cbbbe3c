"""The episodes of a diagnosis, and their changes to the next: what began, grew or ended.

Each diagnosis reports a fault anew, perhaps in parts or under another name now that more is known.
An episode is what an operator would call one and the same event.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

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
from rulec_runtime.report.blindness import brought_back, told_else, unseen
from rulec_runtime.report.growth import grown
from rulec_runtime.report.json_form import growth_form
from rulec_runtime.report.wording import actions


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
        span, condition = (sensor.since, sensor.until, sensor.active), sensor.condition
        one = _lasting("sensor", sensor.id, span, condition.status, sensor.text, condition.action)
        yield replace(one, module=sensor.module, probability=sensor.probability)
    for found in diagnosis.regimes:
        span, regime = (found.since, found.until, found.active), found.regime
        one = _lasting("regime", regime.id, span, regime.status, regime.text, regime.action)
        yield replace(one, module=regime.module)
    for blind in diagnosis.blind:
        if blind.until - blind.since >= horizon.usual:
            # The readings identify it, whichever faults currently need them.
            readings, span = " ".join(blind.readings), (blind.since, blind.until, blind.active)
            text = f"{unseen(diagnosis.ruleset, blind)}: {blind.because}"
            one = _lasting("blind", readings, span, "C", text, brought_back(blind))
            yield replace(one, id=_id("blind", blind.since))
    others: tuple[tuple[Kind, str, Iterable[Period]], ...] = (
        ("unknown", "S", diagnosis.unknown),
        ("blind", "C", (p for p in told_else(diagnosis) if not p.partly)),
    )
    for kind, status, periods in others:
        for period in periods:
            active = period.until >= horizon.settled
            until = horizon.until if active else period.until
            if until - period.since >= horizon.usual:
                subject = period.text if kind == "blind" else ""
                one = _lasting(kind, subject, (period.since, until, active), status, period.text)
                yield replace(one, id=_id(kind, period.since))


def _lasting(
    kind: Kind,
    subject: str,
    span: tuple[float, float, bool],
    status: str,
    text: str,
    action: str = "",
) -> Episode:
    """An episode without a degree; `span` is when it began, its last time, and whether it lasts."""
    since, until, active = span
    return Episode(
        id=_id(subject, since),
        kind=kind,
        subject=subject,
        module="",
        status=status,
        since=since,
        until=until,
        active=active,
        text=text,
        action=action,
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


def changes(
    ruleset: Ruleset, known: Sequence[Episode], diagnosis: Diagnosis, horizon: Horizon, number: int
) -> tuple[tuple[Episode, ...], tuple[Event, ...]]:
    """The current episodes, and events for what is new.

    `known` are the episodes reported before that are active or within the horizon; `number` is that
    of the last event.
    """
    found = every = _merged(episodes_of(diagnosis, horizon), horizon)
    # Windows move with every row, so what a few rows of a plant that stores show may fluctuate.
    wait = 0 if ruleset.dynamics is None else rows_of_a_finding(len(horizon.time))
    reported: list[tuple[What, str, Episode]] = []
    kept: list[Episode] = []
    for old in known:
        if old.kind == "source":
            kept.append(old)
            continue
        mine = [one for one in found if _same(old, one, horizon)]
        if not mine and _may_return(old, known, found, horizon, wait):
            kept.append(old)
            continue
        if not wait and _was_false(old, every, horizon):
            reported.append(("withdrawn", _words(ruleset, "withdrawn", old, old), old))
            continue
        found = [one for one in found if one not in mine]
        now = replace(
            mine[-1] if mine else old, id=old.id, since=min([old.since, *(e.since for e in mine)])
        )
        if not mine:
            now = replace(now, active=False)
        elif now.active and not old.active and horizon.rows_between(old.until, now.until) < wait:
            now = old
        now = replace(now, told=old.told)
        what = _what(old, now, bool(mine), horizon)
        if not wait and _was_earlier(old, now, horizon):
            what = "changed"
        if what is not None:
            now = replace(now, told=(now.until, now.degree))
            reported.append((what, _words(ruleset, what, old, now), now))
        kept.append(now)
    for new in (replace(one, told=(one.until, one.degree)) for one in found):
        kept.append(new)
        reported.append(("began", _words(ruleset, "began", new, new), new))
        if not new.active:
            reported.append(("ended", _words(ruleset, "ended", new, new), new))
    kept = [one for one in kept if one.active or one.until >= horizon.since]
    events = (
        Event(number=number + 1 + i, time=horizon.until, what=what, text=text, episode=episode)
        for i, (what, text, episode) in enumerate(reported)
    )
    return tuple(kept), tuple(events)


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
    old: Episode, known: Sequence[Episode], found: Sequence[Episode], horizon: Horizon, wait: int
) -> bool:
    """Whether it is too early to end an episode. That takes as many rows as beginning one, unless a
    new fault explains the same rows."""
    if not old.active or old.kind not in ("fault", "unknown"):
        return False
    for one in found:
        new = not any(_same(other, one, horizon) for other in known)
        if new and one.kind == "fault" and _at_one_time(old, one):
            return False
    return horizon.rows_between(old.until, horizon.until) < wait


def _was_false(old: Episode, found: Sequence[Episode], horizon: Horizon) -> bool:
    """Whether later readings refute a fault that has ended: it is not found any more, although the
    horizon still covers its rows."""
    ended = old.kind == "fault" and not old.active and old.since >= horizon.since
    return ended and not any(_same(old, one, horizon) for one in found)


def _was_earlier(old: Episode, now: Episode, horizon: Horizon) -> bool:
    """Whether a fault that has ended began long before the reported time."""
    ended = old.kind == "fault" and not old.active and not now.active
    return ended and horizon.rows_between(now.since, old.since) > SETTLING


def _what(old: Episode, now: Episode, found: bool, horizon: Horizon) -> What | None:
    """What is new about an episode; None if an operator need not know."""
    if old.active and not now.active:
        # A fault beyond the horizon has ended; one within it that is not found was false.
        return "ended" if found or old.until < horizon.since or old.kind != "fault" else "withdrawn"
    if not old.active:
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
            return f"{name} {again}: {now.text}".strip()
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
