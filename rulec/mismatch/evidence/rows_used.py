"""Count the rows of a recording by their use, and by why others were not used.

Every row is counted once, so that the counts sum to all rows: nothing is omitted unreported.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.result import Evidence

SEARCHED = "for search and fit"
HELD_OUT = "held out"


def counted_rows(used: Iterable[str], unused: Iterable[str]) -> tuple[Evidence, ...]:
    """Counts of rows by their use, used ones first, then by falling number."""
    found = []
    for served, texts in ((True, used), (False, unused)):
        known = sorted(Counter(texts).items(), key=lambda entry: (-entry[1], entry[0]))
        found += [Evidence(rows, served, because) for because, rows in known]
    return tuple(found)


def unread(recording: Recording) -> list[str]:
    """Why each row of the files that is no part of the recording was left out."""
    return [because for rows, because in recording.left_out for _ in range(rows)]
