"""Several recordings judged together: rows of each, and what each further one changed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import percent

from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.result import Moved, OfRecording, Update
from rulec.mismatch.search.settled.by_recording import ByRecording

SHOWN = 3
"""Explanations in the sentence on a further recording."""


def of_recordings(recording: Recording, rows: Rows, found: ByRecording) -> tuple[OfRecording, ...]:
    """Each recording in the order given, with its rows and what it says alone."""
    source = recording.source
    assert source is not None
    data = rows.system.data
    serves = np.zeros(len(data), dtype=bool)
    serves[rows.group_point] = True
    used = (data.sample >= 0) & serves[np.maximum(data.sample, 0)]
    return tuple(
        OfRecording(
            name=recording.sources[alone.number],
            rows=int((source == alone.number).sum()),
            used=int((used & (source == alone.number)).sum()),
            verdict=alone.verdict,
            alone=alone.likely,
        )
        for alone in found.alone
    )


def updates_of(names: Sequence[str], found: ByRecording) -> tuple[Update, ...]:
    """What each further recording changed."""
    return tuple(
        Update(names[number], told(names[number], moved), moved)
        for number, moved in found.moved.items()
    )


def told(name: str, moved: Sequence[Moved]) -> str:
    """What a further recording changed, in one sentence.

    >>> told("b.csv", [Moved("x", "slip", 0.5, 0.97), Moved("y", "friction", 0.25, 0.02)])
    'With b.csv: slip 50\xa0% -> 97\xa0%; friction 25\xa0% -> 2\xa0%'
    """
    shown = [f"{m.title} {_share(m)}" for m in moved[:SHOWN]]
    return f"With {name}: {'; '.join(shown)}"


def _share(moved: Moved) -> str:
    after = percent(moved.after)
    return after if moved.before is None else f"{percent(moved.before)} -> {after}"
