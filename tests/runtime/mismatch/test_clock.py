"""Points and files without a common time: nothing there follows a clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rulec_runtime.recordings.recording import Recording

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
    degree = np.where(np.arange(300) < 150, 0.0, 0.3)
    return recorded(alone(), tour(alone()[0], 300), {"A.leakage": {"x": degree}})


def test_a_run_has_a_clock_and_a_table_has_none() -> None:
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
    found = compared(alone(), replace(leaking(), one_clock=False))
    assert any("no common time" in note for note in found.notes)
    assert found.hidden is None
    assert not any(f.periods for f in found.findings)
    assert not any(place.periods for place in found.locations)
