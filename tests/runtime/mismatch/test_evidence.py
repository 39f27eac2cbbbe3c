"""Every row of a recording is counted once: what it served for, or why it did not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.mismatch.evidence.steady.rows_used import TOO_MANY, UNSETTLED, evidence_of
from rulec.mismatch.result import Evidence
from tests.runtime.mismatch.made import alone, changed, prepared, recorded, rows_at, tour

SAMPLES = 300


def counted(recording: Recording) -> tuple[Evidence, ...]:
    rows = rows_at(alone(), recording)
    return evidence_of(recording, rows.system.data, rows)


def rows(told: tuple[Evidence, ...], because: str) -> int:
    return sum(e.rows for e in told if because in e.because)


def test_every_row_is_counted_once() -> None:
    """Settled, held out and unsettled rows sum to the recording, as do those of a pump that stands,
    which vanished in silence, and those spared: of many short stretches every so-manyth is taken.
    All are unsettled where there is no point."""
    rules, _ = alone()
    recording = recorded(alone(), tour(rules, SAMPLES))
    told = counted(recording)
    assert SAMPLES == sum(e.rows for e in told)
    assert rows(told, UNSETTLED) > 0
    assert all(e.used != (e.because == UNSETTLED) for e in told)
    least = rules.signal_by_id["A.n"].minimum
    assert least is not None
    slow = recording.values["A.n"].copy()
    slow[100:150] = 0.5 * least
    told = counted(changed(recording, {"A.n": slow}))
    assert SAMPLES == sum(e.rows for e in told)
    assert rows(told, "A.n is below") >= 40
    assert not any(e.used for e in told if "A.n is below" in e.because)
    data = prepared(rules, recording)
    spared = replace(data, sample=np.where(data.sample > 3, -2, data.sample))
    told = evidence_of(recording, spared)
    assert rows(told, TOO_MANY) == int((spared.sample == -2).sum()) > 0
    assert (Evidence(SAMPLES, False, UNSETTLED),) == evidence_of(recording, None)


def test_rows_that_cannot_be_read_are_counted(tmp_path: Path) -> None:
    """Rows without time, with a time that was there, or too few cells are rows of the file."""
    rules, _ = alone()
    names = [s for s in rules.signals if s.id in rules.read]
    head = ",".join(["time [s]", *(f"{s.id} [{s.unit}]" for s in names)])
    cells = ",".join("1" for _ in names)
    times = ["0", "1", "1", "", *(str(i) for i in range(2, 20))]
    lines = [head, *(f"{t},{cells}" for t in times), "20"]
    file = tmp_path / "some.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    told = evidence_of(read_recording(file, rules), None)
    assert len(lines) - 1 == sum(e.rows for e in told)
    assert 1 == rows(told, "no usable time") == rows(told, "repeat the time")
