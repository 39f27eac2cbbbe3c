"""Points and files without a common time: nothing there follows a clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.result import Mismatch
from rulec.mismatch.search.periods import intermittent
from tests.runtime.mismatch.dynamic.benches import bench, made
from tests.runtime.mismatch.made import HOLD, alone, compared, recorded, tour

SAMPLES = 300


def leaking() -> Recording:
    """A pump that leaks in the second half."""
    rules, _ = alone()
    degree = np.where(np.arange(SAMPLES) < SAMPLES // 2, 0.0, 0.3)
    return recorded(alone(), tour(rules, SAMPLES), {"A.leakage": {"x": degree}})


def table(recording: Recording) -> Recording:
    """One row of each operating point."""
    rows = np.arange(HOLD // 2, len(recording), HOLD)
    values = {name: v[rows] for name, v in recording.values.items()}
    n = len(rows)
    return Recording(
        time=np.arange(n, dtype=float),
        values=values,
        segment=np.zeros(n, dtype=int),
        missing=(),
        notes=(),
    )


def system_of(recording: Recording) -> System:
    rules, builder = alone()
    data = prepare(recording, rules)
    assert data is not None
    return System(rules, builder, data)


def test_a_run_has_a_clock() -> None:
    """In one recording effects of time are candidates, and the fault has its periods."""
    system = system_of(leaking())
    assert system.data.timed
    assert any(c.follows_time for c in system.candidates)


def test_a_table_has_none() -> None:
    """No candidate of a table follows time."""
    system = system_of(table(leaking()))
    assert system.data.of_rows
    assert not system.data.timed
    assert system.candidates
    assert not any(c.follows_time for c in system.candidates)


def test_files_of_their_own_have_none() -> None:
    """Of files that begin anew no fault begins, and no driver that nobody recorded has a course."""
    for one_clock in (True, False):
        system = system_of(replace(leaking(), one_clock=one_clock))
        rows = rows_of(system, Configuration())
        plain = fit(rows, Configuration(), system.data.open)
        assert one_clock == bool(list(intermittent(plain, system.candidates)))


def test_the_answer_says_so() -> None:
    """Nothing in an answer has a time then, and a note tells why."""
    found: Mismatch = compared(alone(), replace(leaking(), one_clock=False))
    assert any("no common time" in note for note in found.notes)
    assert found.hidden is None
    assert not any(f.periods for f in found.findings)
    assert not any(place.periods for place in found.locations)


def test_tanks_of_several_files() -> None:
    """Where plants store, nothing that begins at some time is looked for in such files."""
    run = made()
    assert any(c.follows_time for c in bench(run).candidates)
    assert not any(c.follows_time for c in bench(replace(run, one_clock=False)).candidates)


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
