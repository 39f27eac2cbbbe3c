"""Points and files without a common time: nothing there follows a clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.mismatch.search.intermittent_fault import intermittent
from tests.runtime.mismatch.dynamic.benches import bench, made
from tests.runtime.mismatch.made import (
    HOLD,
    alone,
    compared,
    fitted,
    recorded,
    rows_at,
    sampled,
    tour,
)


def leaking() -> Recording:
    """A pump that leaks in the second half."""
    degree = np.where(np.arange(300) < 150, 0.0, 0.3)
    return recorded(alone(), tour(alone()[0], 300), {"A.leakage": {"x": degree}})


def test_a_run_has_a_clock_and_a_table_has_none() -> None:
    """In one recording effects of time are candidates; in one row of each point none is."""
    run = leaking()
    rows = np.arange(HOLD // 2, len(run), HOLD)
    table = sampled({name: v[rows] for name, v in run.values.items()})
    for recording, timed in ((run, True), (table, False)):
        system = rows_at(alone(), recording).system
        assert system.data.timed is timed
        assert system.data.of_rows is not timed
        assert any(c.follows_time for c in system.candidates) is timed
        assert system.candidates


def test_files_of_their_own_have_none() -> None:
    """Of files that begin anew no fault begins, where plants store, too, and no driver that nobody
    recorded has a course."""
    for one_clock in (True, False):
        found = fitted(alone(), replace(leaking(), one_clock=one_clock))
        assert one_clock == bool(list(intermittent(found, found.rows.system.candidates)))
        tanks = bench(replace(made(), one_clock=one_clock))
        assert one_clock == any(c.follows_time for c in tanks.candidates)


def test_the_answer_says_so() -> None:
    """Nothing in an answer has a time then, and a note tells why."""
    found = compared(alone(), replace(leaking(), one_clock=False))
    assert any("no common time" in note for note in found.notes)
    assert found.hidden is None
    assert not any(f.periods for f in found.findings)
    assert not any(place.periods for place in found.locations)


def test_clocks_of_files(tmp_path: Path) -> None:
    """Files behind each other have one clock, those that all begin at zero have not."""
    rules, _ = alone()
    names = [s for s in rules.signals if s.id in rules.read]
    head = ",".join(["time [s]", *(f"{s.id} [{s.unit}]" for s in names)])
    for folder, starts in (("one", (0, 100)), ("own", (0, 0))):
        place = tmp_path / folder
        place.mkdir()
        for i, start in enumerate(starts):
            lines = [f"{start + k}," + ",".join("1" for _ in names) for k in range(30)]
            (place / f"{i}.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
        assert (folder == "one") == read_recording(place, rules).one_clock
