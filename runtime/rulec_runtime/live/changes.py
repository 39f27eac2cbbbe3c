"""What has changed from one diagnosis to the next: episodes that began, grew, ended.

A diagnosis tells of a fault anew every time, perhaps in parts, or by another name now that more is
known. An episode is what an operator would call one and the same thing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.degree import degree_in_figures
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.findings import Finding, Period
from rulec_runtime.limits import HEADLINE_RIVAL
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Episode, Event, Kind, What


@dataclass(frozen=True, kw_only=True)
class Sight:
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


def changes(
    ruleset: Ruleset,
    known: Sequence[Episode],
    diagnosis: Diagnosis,
    sight: Sight,
    number: int,
) -> tuple[tuple[Episode, ...], tuple[Event, ...]]:
    """Episodes as they are now, and what is new of them.

    `known` are those told before that are active, or may still be seen; `number` is that of the
    last event.
    """
    seen = _merged(episodes_of(ruleset, diagnosis, sight), sight)
    told: list[tuple[What, str, Episode]] = []
    kept: list[Episode] = []
    for old in known:
        if old.kind == "source":
            kept.append(old)
            continue
        mine = [one for one in seen if _same(old, one, sight)]
        seen = [one for one in seen if one not in mine]
        now = replace(
            mine[-1] if mine else old, id=old.id, since=min([old.since, *(e.since for e in mine)])
        )
        if not mine:
            now = replace(now, active=False)
        kept.append(now)
        what = _what(old, now, bool(mine), sight)
        if what is not None:
            told.append((what, _words(ruleset, what, old, now), now))
    for new in seen:
        kept.append(new)
        told.append(("began", _words(ruleset, "began", new, new), new))
        if not new.active:
            told.append(("ended", _words(ruleset, "ended", new, new), new))
    kept = [one for one in kept if one.active or one.until >= sight.since]
    events = (
        Event(number=number + 1 + i, time=sight.until, what=what, text=text, episode=episode)
        for i, (what, text, episode) in enumerate(told)
    )
    return tuple(kept), tuple(events)


def episodes_of(ruleset: Ruleset, diagnosis: Diagnosis, sight: Sight) -> Iterator[Episode]:
    """All that a diagnosis tells and that lasts."""
    for finding in diagnosis.findings:
        yield _of_fault(finding)
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
    others: tuple[tuple[Kind, str, tuple[Period, ...]], ...] = (
        ("unknown", "S", diagnosis.unknown),
        ("blind", "C", diagnosis.not_judged),
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


def _merged(episodes: Iterable[Episode], sight: Sight) -> list[Episode]:
    """Of one subject at one time, or before and behind a gap, a single episode: the latest word on
    it."""
    found: list[Episode] = []
    for one in episodes:
        mine = [i for i, e in enumerate(found) if _of_one_subject(e, one)]
        same = [i for i in mine if _at_one_time(found[i], one) or _goes_on(found[i], one, sight)]
        if same:
            first = found[same[0]]
            until, active = max(first.until, one.until), first.active or one.active
            latest = one if one.until >= first.until else first
            since = min(first.since, one.since)
            found[same[0]] = replace(latest, since=since, until=until, active=active)
        else:
            found.append(one)
    return found


def _of_one_subject(one: Episode, other: Episode) -> bool:
    return one.kind == other.kind and one.subject == other.subject


def _at_one_time(one: Episode, other: Episode) -> bool:
    return one.since <= other.until and other.since <= one.until


def _of_fault(finding: Finding) -> Episode:
    fault = finding.fault
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
        action=fault.action,
        degree=finding.degree,
        lower=finding.lower,
        upper=finding.upper,
        unit=fault.unit,
        probability=finding.probability,
        alternatives=finding.alternatives,
    )


def _id(subject: str, since: float) -> str:
    return f"{subject}@{since:.3f}"


def _same(old: Episode, new: Episode, sight: Sight) -> bool:
    """Is it what was told before? A fault may have another name by now: one of those that fitted
    about as well."""
    if old.kind != new.kind:
        return False
    if _at_one_time(old, new):
        names = {old.subject, *(name for name, _ in old.alternatives)}
        others = {new.subject, *(name for name, _ in new.alternatives)}
        return bool(names & others)
    return _of_one_subject(old, new) and old.active and _goes_on(old, new, sight)


def _goes_on(first: Episode, second: Episode, sight: Sight) -> bool:
    """Does one follow the other with next to no rows between them?"""
    between = sight.rows_between(first.until, second.since)
    return first.until < second.since and between <= sight.pause


def _what(old: Episode, now: Episode, found: bool, sight: Sight) -> What | None:
    """What is new of an episode; None if nothing is that an operator needs to know."""
    if old.active and not now.active:
        # What can be seen no more has ended; what could be and is not was none.
        return "ended" if found or old.until < sight.since or old.kind != "fault" else "withdrawn"
    if not old.active:
        return "began" if found and now.active else None
    half = max(old.upper - old.degree, old.degree - old.lower)
    grown = abs(now.degree - old.degree) > limits.GROWN * half > 0.0
    renamed = now.subject != old.subject
    return "changed" if renamed or grown or _rivals(now) != _rivals(old) else None


def _rivals(episode: Episode) -> set[str]:
    """What else an operator should think of at once."""
    return {name for name, p in episode.alternatives if p >= HEADLINE_RIVAL}


def _words(ruleset: Ruleset, what: What, old: Episode, now: Episode) -> str:
    """What is new, for people."""
    if now.kind != "fault":
        name = now.subject if now.kind == "sensor" else ""
        if what in ("ended", "withdrawn"):
            again = {"sensor": "healthy again", "blind": "judged again"}.get(now.kind, "over")
            return f"{name} {again}: {now.text}".strip()
        return now.text
    fault = ruleset.fault_by_id[now.subject]
    degree, low, high = (degree_in_figures(fault, x) for x in (now.degree, now.lower, now.upper))
    size = f"{now.subject} {degree} ({low} to {high})"
    if what == "withdrawn":
        return f"{now.subject}: later readings do not bear it out"
    if what == "ended":
        return f"{size} is over"
    rivals = ", ".join(sorted(_rivals(now)))
    also = f"; also possible: {rivals}" if rivals else ""
    if what == "changed" and now.subject != old.subject:
        return f"{size}, told as {old.subject} before{also}"
    return f"{size}{also}"
