"""The bounded memory of a watch."""

from dataclasses import dataclass, replace

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.episode import Episode
from rulec_runtime.live.history import History
from rulec_runtime.live.rows import Rows
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.recording import Recording


@dataclass(frozen=True, kw_only=True)
class Memory:
    """Everything kept of the rows received; bounded.

    Attributes
    ----------
    recent : the latest rows.
    before : operating points of the rows before these; None for a plant that stores.
    count : rows received.
    episodes : reported episodes that are active, or within the horizon.
    number : events reported so far.
    """

    recent: Recording
    before: History | None = None
    count: int = 0
    episodes: tuple[Episode, ...] = ()
    number: int = 0


def nothing_yet(dated: bool, place: str = "") -> Memory:
    """Memory before the first row; `dated` if times are seconds since 1970 in UTC, shown by the
    clocks of `place`, a time zone."""
    return Memory(
        recent=Recording(
            time=np.zeros(0),
            values={},
            segment=np.zeros(0, dtype=int),
            missing=(),
            notes=(),
            calendar=Calendar(0.0, ((-np.inf, 0.0),), place) if dated else None,
        )
    )


def appended(ruleset: Ruleset, recent: Recording, rows: Rows, part: slice) -> Recording:
    """The latest rows followed by new ones; a new signal is NaN before its first reading."""
    time = rows.time[part]

    def column(name: str) -> Array:
        old, new = recent.values.get(name), rows.values.get(name)
        return np.concatenate(
            [
                np.full(len(recent), np.nan) if old is None else old,
                np.full(len(time), np.nan) if new is None else new[part],
            ]
        )

    here = recent.values.keys() | rows.values.keys()
    values = {s.id: column(s.id) for s in ruleset.signals if s.id in here}
    segment = int(recent.segment[-1]) if len(recent) else 0
    return replace(
        recent,
        time=np.concatenate([recent.time, time]),
        values=values,
        segment=np.concatenate([recent.segment, np.full(len(time), segment)]),
        missing=tuple(s.id for s in ruleset.signals if s.id in ruleset.read and s.id not in values),
    )


def without_first(recent: Recording, cut: int) -> Recording:
    """The rows without the first `cut` ones."""
    return _chosen(recent, np.arange(cut, len(recent))) if cut else recent


def reference_and_latest(recent: Recording, episodes: tuple[Episode, ...]) -> Recording:
    """The latest rows; with an active fault also those before it, for comparison."""
    n, count = len(recent), limits.KEPT_ROWS
    active = [one.since for one in episodes if one.kind == "fault" and one.active]
    sound = int(np.searchsorted(recent.time, min(active))) if active else 0
    first = np.arange(max(sound - count // 2, 0), sound) if sound < n - count else np.arange(0)
    chosen = np.concatenate([first, np.arange(n - count, n)])
    rows = _chosen(recent, chosen.astype(int))
    latest = np.arange(len(chosen)) >= len(first)
    return replace(rows, segment=np.where(latest, rows.segment.max() + 1, rows.segment))


def _chosen(recent: Recording, chosen: np.ndarray) -> Recording:
    return replace(
        recent,
        time=recent.time[chosen],
        values={name: column[chosen] for name, column in recent.values.items()},
        segment=recent.segment[chosen],
    )
