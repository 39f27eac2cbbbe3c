"""Nonparametric terms at the true place of an effect without an entry: the best possible answer.

No entry has the true law, so it cannot be refitted. A term without a name stands for it at the true
place: any smooth function of time or of one reading. If it gains no more than the answer, or less
than any answer needs, no better search would have found the place.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.locate import suspects
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search.latent_input import free_course, reconstruct
from rulec.prove.aligned import driver_of, likeness
from rulec.prove.campaign import DRIVER


def course_at(folder: Path, rows: Rows, places: Collection[str]) -> float | None:
    """Correlation of a free course at one of some places with the opened driver; None without."""
    file = folder / DRIVER
    if not file.exists() or not rows.system.data.timed:
        return None
    plain = fit(rows, Configuration(), rows.system.data.open)
    here = [s for s in suspects(plain) if f"{s.spot.module}.{s.spot.place}" in places]
    if not here:
        return None
    trial = free_course(plain, here[0])
    setting = plain.setting.joining(trial.candidate, trial.values, trial.fixed, trial.course)
    found = reconstruct(fit(rows, setting, plain.used), trial.candidate.id)
    return likeness(found.time, found.course, *driver_of(file.read_text(encoding="utf-8")))
