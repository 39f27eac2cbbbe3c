"""Killed between events and state: rows come again in other blocks, and nothing is told twice."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rulec_runtime.live import state
from rulec_runtime.live.episode import Event
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.live.journal.lines import LinesFile
from rulec_runtime.live.journal_replay import ReplayedSource, replayed
from rulec_runtime.live.rows import Notice, Rows

from tests.live.test_follower import followed, recording_of
from tests.rig.follower.plants import part_of


class Recorded:
    """A source that has all rows, and gives five at a time."""

    dated = ended = False

    def __init__(self, rows: list[Rows]) -> None:
        self._rows = rows

    def take(self, seconds: float) -> list[Rows | Notice]:
        return [self._rows.pop(0)] if self._rows else []

    def close(self) -> None:
        pass


def test_what_was_told_is_told_no_more(tmp_path: Path) -> None:
    """Names that were told too early row by row; told at once, the same rows give other names."""
    rules, recording = recording_of("abc", "swapped.csv")
    early = nothing_yet(False)
    kept = state.to_bytes(rules, early, {})
    memory, told = early, []
    for row in range(10):
        for part in follow(rules, memory, part_of(recording, row, row + 1)):
            memory, told = part.memory, [*told, *part.events]
    final = {f.subject for f in followed(rules, recording, 1000)[0].episodes if f.active}
    assert {e.episode.subject for e in told if e.what == "began"} - final
    file = LinesFile(tmp_path / "events.jsonl")
    file.commit("abc", told, None, dated=False)
    # Killed here: the state is that before the first row.
    early, _ = state.from_bytes(rules, kept, "x")
    ahead = file.after("abc", early.number)
    # Where a degree goes, the next row says again.
    bare = [replace(e, episode=replace(e.episode, growth={}, told=None)) for e in told]
    assert ahead == bare
    file.close()
    again = replayed(early, ahead)
    assert again.number == len(told)
    blocks = [part_of(recording, k, k + 5) for k in range(0, len(recording), 5)]
    source, events = ReplayedSource(Recorded(list(blocks)), ahead), list[Event]()
    while came := source.take(0.0):
        for block in came:
            assert isinstance(block, Rows)
            for part in follow(rules, again, block):
                again, events = part.memory, [*events, *part.events]
    every = [*told, *events]
    assert [e.number for e in every] == list(range(1, len(every) + 1))
    active = {e.id for e in again.episodes if e.active}
    last = {e.episode.id: e for e in every}
    assert {name for name, e in last.items() if e.what in ("began", "changed")} == active
    assert {e.subject for e in again.episodes if e.active} == final
    there = set[str]()
    for event in every:
        assert event.what != "began" or event.episode.id not in there
        (there.discard if event.what in ("ended", "withdrawn") else there.add)(event.episode.id)
