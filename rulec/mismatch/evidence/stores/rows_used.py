"""What each row of a recording of a plant that stores served for: nothing has to settle there."""

from __future__ import annotations

from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.rows_used import HELD_OUT, SEARCHED, counted_rows, unread
from rulec.mismatch.evidence.samples import HELDOUT
from rulec.mismatch.evidence.stores.record import Record
from rulec.mismatch.result import Evidence


def stored_evidence(recording: Recording, record: Record) -> tuple[Evidence, ...]:
    """Count the rows of a recording."""
    used: list[str] = []
    unused = unread(recording)
    rows = zip(record.sample.tolist(), record.read.tolist(), record.odd.tolist(), strict=True)
    for sample, there, strange in rows:
        if sample < 0:
            unused.append("too few rows at the end for a mean")
        elif there:
            what = HELD_OUT if record.part[sample] == HELDOUT else SEARCHED
            used.append(f"{what}; a reading is set aside" if strange else what)
        elif strange:
            unused.append("readings stand still, or jump for one row")
        else:
            unused.append("no reading to compare with; the simulation runs through")
    return counted_rows(used, unused)
