"""Everything an operator can see at one moment, and how old it is; updated after each change."""

import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import monotonic

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, worst
from rulec_runtime.live.connection import is_away
from rulec_runtime.live.episode import Episode, Event
from rulec_runtime.live.follower import diagnosis_of
from rulec_runtime.live.limits import PAST
from rulec_runtime.live.memory import Memory
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.report.wording import STATUS


@dataclass(frozen=True, kw_only=True)
class Now:
    """The present state of the plant.

    Attributes
    ----------
    time : of the last row, s; None before any. `calendar` converts it to a date.
    status : letter of NE 107 of all active episodes, or ``ok``.
    source, connected, remark : the source, whether rows come from it, and its last notice.
    rows : number of rows received.
    came : when the last row came, s, by the monotonic clock here: clocks of plants go wrong.
    active : episodes that have not ended, the worst first.
    past : the latest events, newest first.
    acknowledged : ids of acknowledged episodes.
    diagnosis : of the rows in memory; None before anything could be judged.
    """

    plant: str
    title: str
    source: str
    time: float | None = None
    calendar: Calendar | None = None
    status: str = "ok"
    connected: bool = False
    remark: str = ""
    rows: int = 0
    active: tuple[Episode, ...] = ()
    past: tuple[Event, ...] = ()
    acknowledged: frozenset[str] = frozenset()
    diagnosis: Diagnosis | None = None
    came: float | None = None

    @property
    def age(self) -> float | None:
        """Seconds since the last row came; None before any."""
        return None if self.came is None else max(monotonic() - self.came, 0.0)

    @property
    def ruleset(self) -> Ruleset | None:
        """That of the diagnosis."""
        return self.diagnosis.ruleset if self.diagnosis else None

    @property
    def judged(self) -> bool:
        """Whether anything was judged; otherwise the absence of findings means nothing."""
        return self.diagnosis is not None and self.diagnosis.judged > 0


class Present:
    """The present moment, at first from the memory of an earlier process; for several threads."""

    def __init__(self, ruleset: Ruleset, source: str, memory: Memory) -> None:
        self._lock = threading.Lock()
        self._past: deque[Event] = deque(maxlen=PAST)
        self._now = Now(plant=ruleset.plant, title=ruleset.title, source=source)
        self.update(memory, (), diagnosis_of(ruleset, memory))
        read = self._now.connected and memory.count > 0
        self._now = replace(self._now, connected=read, came=None)

    def now(self) -> Now:
        """The present moment."""
        return self._now

    def update(self, memory: Memory, events: Sequence[Event], diagnosis: Diagnosis | None) -> None:
        """Update after rows or a notice, with the events."""
        order = list(STATUS)
        ongoing = (one for one in memory.episodes if one.active)
        active = tuple(sorted(ongoing, key=lambda one: (order.index(one.status), one.since)))
        remarks = [event.text for event in events if event.episode.kind == "source"]
        with self._lock:
            self._past.extendleft(events)
            time = memory.recent.time
            self._now = replace(
                self._now,
                time=float(time[-1]) if len(time) else None,
                calendar=memory.recent.calendar,
                status=worst({one.status for one in active}),
                connected=not any(map(is_away, active)),
                remark=remarks[-1] if remarks else self._now.remark,
                rows=memory.count,
                came=self._now.came if memory.count == self._now.rows else monotonic(),
                active=active,
                past=tuple(self._past),
                diagnosis=diagnosis or self._now.diagnosis,
            )

    def recall(self, events: Sequence[Event]) -> None:
        """Add events of an earlier process, oldest first."""
        with self._lock:
            self._past.extendleft(events)
            self._now = replace(self._now, past=tuple(self._past))

    def acknowledge(self, episode: str, by: str) -> None:
        """Mark an episode as acknowledged."""
        self.acknowledged(frozenset([episode]))

    def acknowledged(self, episodes: frozenset[str]) -> None:
        """Mark episodes as acknowledged, here or elsewhere."""
        with self._lock:
            every = self._now.acknowledged | episodes
            self._now = replace(self._now, acknowledged=every)
