"""Every row of a recording is counted once: what it served for, or why it did not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.rows_used import TOO_MANY, UNSETTLED, evidence_of
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.result import Evidence
from tests.runtime.mismatch.made import alone, recorded, tour

SAMPLES = 300


def counted(recording: Recording) -> tuple[Evidence, ...]:
    rules, builder = alone()
    data = prepare(recording, rules)
    assert data is not None
    rows = rows_of(System(rules, builder, data), Configuration())
    return evidence_of(recording, data, rows)


def run(samples: int = SAMPLES) -> Recording:
    rules, _ = alone()
    return recorded(alone(), tour(rules, samples))


def rows(told: tuple[Evidence, ...], because: str) -> int:
    return sum(e.rows for e in told if because in e.because)


def test_every_row_is_counted_once() -> None:
    """Settled, held out and unsettled rows sum to the recording."""
    told = counted(run())
    assert SAMPLES == sum(e.rows for e in told)
    assert rows(told, UNSETTLED) > 0
    assert all(e.used != (e.because == UNSETTLED) for e in told)


def test_what_cannot_be_compared_is_told_with_its_reason() -> None:
    """Rows of a pump that stands vanished in silence."""
    healthy = run()
    values = {name: v.copy() for name, v in healthy.values.items()}
    signal = next(s for s in alone()[0].signals if s.is_input and s.minimum is not None)
    assert signal.minimum is not None
    values[signal.id][100:150] = 0.5 * signal.minimum
    told = counted(replace(healthy, values=values))
    assert SAMPLES == sum(e.rows for e in told)
    assert rows(told, f"{signal.id} is below") >= 40
    assert not any(e.used for e in told if f"{signal.id} is below" in e.because)


def test_rows_spared_are_told() -> None:
    """Of many short stretches every so-manyth is taken; the others are no longer silent."""
    rules, _ = alone()
    recording = run()
    data = prepare(recording, rules)
    assert data is not None
    spared = replace(data, sample=np.where(data.sample > 3, -2, data.sample))
    told = evidence_of(recording, spared)
    assert rows(told, TOO_MANY) == int((spared.sample == -2).sum()) > 0


def test_nothing_settled() -> None:
    """All rows are unsettled where there is no point."""
    assert (Evidence(SAMPLES, False, UNSETTLED),) == evidence_of(run(), None)


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
    recording = read_recording(file, rules)
    told = evidence_of(recording, None)
    assert len(lines) - 1 == sum(e.rows for e in told)
    assert 1 == rows(told, "no usable time") == rows(told, "repeat the time")
