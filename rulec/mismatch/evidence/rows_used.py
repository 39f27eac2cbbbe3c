"""What each row of a recording served for, and why others served for nothing.

Every row is counted once, so that the counts sum to the rows that were recorded: what is left out
in silence may be what speaks most.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.result import Evidence

SEARCHED = "searched and fitted"
HELD_OUT = "held out for the proof"


def counted_rows(used: Iterable[str], unused: Iterable[str]) -> tuple[Evidence, ...]:
    """Rows by what became of them, those that served for something first, then the most."""
    found = []
    for served, texts in ((True, used), (False, unused)):
        known = sorted(Counter(texts).items(), key=lambda entry: (-entry[1], entry[0]))
        found += [Evidence(rows, served, because) for because, rows in known]
    return tuple(found)


def unread(recording: Recording) -> list[str]:
    """Rows of the files that are no part of the recording, one text each."""
    return [because for rows, because in recording.left_out for _ in range(rows)]
