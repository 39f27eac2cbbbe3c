"""What has changed from one diagnosis to the next: episodes that began, grew, ended.

A diagnosis tells of a fault anew every time, perhaps in parts, or by another name now that more is
known. An episode is what an operator would call one and the same thing.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from rulec_runtime.contract.degree import degree_in_figures
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.steady.growth import next_level
from rulec_runtime.diagnosis.stores.windows import rows_of_a_finding
from rulec_runtime.limits import HEADLINE_RIVAL
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Episode, Event, What
from rulec_runtime.live.horizon import Horizon, episodes_of


def changes(
    ruleset: Ruleset,
    known: Sequence[Episode],
    diagnosis: Diagnosis,
    sight: Horizon,
    number: int,
) -> tuple[tuple[Episode, ...], tuple[Event, ...]]:
    """Episodes as they are now, and what is new of them.

    `known` are those told before that are active, or may still be seen; `number` is that of the
    last event.
    """
    seen = every = _merged(episodes_of(diagnosis, sight), sight)
    # Windows are cut anew with every row, so what a few rows say of a plant that stores may waver.
    wait = 0 if ruleset.dynamics is None else rows_of_a_finding(len(sight.time))
    told: list[tuple[What, str, Episode]] = []
    kept: list[Episode] = []
    for old in known:
        if old.kind == "source":
            kept.append(old)
            continue
        mine = [one for one in seen if _same(old, one, sight)]
        if not mine and _may_return(old, known, seen, sight, wait):
            kept.append(old)
            continue
        if not wait and _was_none(old, every, sight):
            told.append(("withdrawn", _words(ruleset, "withdrawn", old, old), old))
            continue
        seen = [one for one in seen if one not in mine]
        now = replace(
            mine[-1] if mine else old, id=old.id, since=min([old.since, *(e.since for e in mine)])
        )
        if not mine:
            now = replace(now, active=False)
        elif now.active and not old.active and sight.rows_between(old.until, now.until) < wait:
            now = old
        now = replace(now, told=old.told)
        what = _what(old, now, bool(mine), sight)
        if not wait and _was_earlier(old, now, sight):
            what = "changed"
        if what is not None:
            now = replace(now, told=(now.until, now.degree))
            told.append((what, _words(ruleset, what, old, now), now))
        kept.append(now)
    for new in (replace(one, told=(one.until, one.degree)) for one in seen):
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


def _merged(episodes: Iterable[Episode], sight: Horizon) -> list[Episode]:
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


def _same(old: Episode, new: Episode, sight: Horizon) -> bool:
    """Is it what was told before? A fault may have another name by now: one of those that fitted
    about as well."""
    if old.kind != new.kind:
        return False
    if _at_one_time(old, new):
        names = {old.subject, *(name for name, _ in old.alternatives)}
        others = {new.subject, *(name for name, _ in new.alternatives)}
        return bool(names & others)
    return _of_one_subject(old, new) and old.active and _goes_on(old, new, sight)


def _goes_on(first: Episode, second: Episode, sight: Horizon) -> bool:
    """Does one follow the other with next to no rows between them?"""
    between = sight.rows_between(first.until, second.since)
    return first.until < second.since and between <= sight.pause


def _may_return(
    old: Episode, known: Sequence[Episode], seen: Sequence[Episode], sight: Horizon, wait: int
) -> bool:
    """Is it too early to say that something is there no more? That takes as many rows as it takes
    to say that it is there, unless a fault begins that explains the same rows."""
    if not old.active or old.kind not in ("fault", "unknown"):
        return False
    for one in seen:
        new = not any(_same(other, one, sight) for other in known)
        if new and one.kind == "fault" and _at_one_time(old, one):
            return False
    return sight.rows_between(old.until, sight.until) < wait


def _was_none(old: Episode, seen: Sequence[Episode], sight: Horizon) -> bool:
    """Is it a fault that has ended, of which nothing is seen any more, though its rows still are?
    More is known now, by the readings behind it."""
    ended = old.kind == "fault" and not old.active and old.since >= sight.since
    return ended and not any(_same(old, one, sight) for one in seen)


def _was_earlier(old: Episode, now: Episode, sight: Horizon) -> bool:
    """Has a fault that has ended been there long before it was told to be?"""
    ended = old.kind == "fault" and not old.active and not now.active
    return ended and sight.rows_between(now.since, old.since) > sight.pause


def _what(old: Episode, now: Episode, found: bool, sight: Horizon) -> What | None:
    """What is new of an episode; None if nothing is that an operator needs to know."""
    if old.active and not now.active:
        # What can be seen no more has ended; what could be and is not was none.
        return "ended" if found or old.until < sight.since or old.kind != "fault" else "withdrawn"
    if not old.active:
        return "began" if found and now.active else None
    renamed = now.subject != old.subject
    return "changed" if renamed or _has_grown(now) or _rivals(now) != _rivals(old) else None


def _has_grown(episode: Episode) -> bool:
    """Is its degree another than when it was told last, and than was to be expected, or at the next
    round number?"""
    if episode.told is None or episode.kind != "fault":
        return False
    time, degree = episode.told
    half = limits.GROWN * max(episode.upper - episode.degree, episode.degree - episode.lower)
    expected = degree + episode.rate * (episode.until - time)
    if not abs(episode.degree - degree) > half > 0.0:
        return False
    passed = next_level(max(degree, half)) != next_level(max(episode.degree, half))
    return passed or abs(episode.degree - expected) > half


def _rivals(episode: Episode) -> set[str]:
    """What else an operator should think of at once."""
    return {name for name, p in episode.alternatives if p >= HEADLINE_RIVAL}


def _words(ruleset: Ruleset, what: What, old: Episode, now: Episode) -> str:
    """What is new, for people."""
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
        return f"{now.subject}: later readings do not bear it out"
    if what == "ended":
        return f"{size} is over"
    if what == "changed" and not now.active:
        return f"{size} is over, and was there earlier than was told"
    rivals = ", ".join(sorted(_rivals(now)))
    also = f"; also possible: {rivals}" if rivals else ""
    if what == "changed" and now.subject != old.subject:
        return f"{size}, told as {old.subject} before{also}"
    return f"{size}{also}" + (f"; {now.grows}" if now.grows else "")
