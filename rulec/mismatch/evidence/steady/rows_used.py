"""Use of each row of a recording of a plant that settles."""

from __future__ import annotations

import numpy as np
from rulec_runtime.diagnosis.steady.observe import reason
from rulec_runtime.recordings.recording import Recording

from rulec.mismatch.evidence.rows_used import HELD_OUT, SEARCHED, counted_rows, unread
from rulec.mismatch.evidence.samples import HELDOUT
from rulec.mismatch.evidence.steady.prepare import SPARED, Data
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.result import Evidence

UNSETTLED = "not settled"
TOO_MANY = "settled, of which only a part is taken as there are so many"
NOTHING_TO_COMPARE = "no two estimates of one flow can be compared there"


def evidence_of(
    recording: Recording,
    data: Data | None,
    rows: Rows | None = None,
    judged: np.ndarray | None = None,
    faulty: np.ndarray | None = None,
) -> tuple[Evidence, ...]:
    """Count the rows of a recording of a plant that has to settle.

    Parameters
    ----------
    data : None where nothing is settled.
    rows : None where no point could be compared.
    judged, faulty : points in the errors of the proof, and in periods of faults, shape (n,); None
        where nothing was proven.
    """
    if data is None:
        return counted_rows((), [*unread(recording), *[UNSETTLED] * len(recording)])
    compared, texts = _points(data, rows, judged, faulty)
    used: list[str] = []
    unused = unread(recording)
    for point in data.sample.tolist():
        if point < 0:
            unused.append(TOO_MANY if point == SPARED else UNSETTLED)
        else:
            (used if compared[point] else unused).append(texts[point])
    return counted_rows(used, unused)


def _points(
    data: Data, rows: Rows | None, judged: np.ndarray | None, faulty: np.ndarray | None
) -> tuple[np.ndarray, list[str]]:
    """Flags of points that are compared, shape (n,), and the use of each, or why it has none."""
    compared = np.zeros(len(data), dtype=bool)
    if rows is not None:
        compared[rows.group_point] = True
    texts = []
    for point in range(len(data)):
        why = _why_not(rows, point)
        if not compared[point]:
            texts.append(why or NOTHING_TO_COMPARE)
            continue
        what = HELD_OUT if data.part[point] == HELDOUT else SEARCHED
        if faulty is not None and faulty[point]:
            what += ", in a period of a fault, so not in the errors"
        elif judged is not None and not judged[point]:
            what += ", not in the errors, as no reading is predicted there"
        texts.append(f"{what} ({why})" if why else what)
    return compared, texts


def _why_not(rows: Rows | None, point: int) -> str:
    """Why the first unusable estimate at a point is unusable; empty where all are usable."""
    if rows is None or not rows.system.observers:
        return ""
    system = rows.system
    for number in np.flatnonzero(~system.valid[:, point]).tolist():
        spec = system.observers[number]
        moving = system.data.moving.get(spec.module)
        if moving is not None and moving[point]:
            return f"{spec.module} is not settled"
        index = system.ruleset.observer_index[spec.id]
        return reason(system.ruleset, system.observed, index, point)
    return ""
