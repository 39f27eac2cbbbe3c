"""Nonparametric terms at the true place of an effect without an entry: the best possible answer.

No entry has the true law, so it cannot be refitted. An error stands for it at the true place: with
a course that is free in time, there or in a parameter of the law, or as a free curve over a
reading. If these gain no more than the answer, or less than any answer needs, no better search
would have found the place.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from rulec.mismatch.evidence.steady.configuration import HIDDEN
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.locate import Suspect, suspects
from rulec.mismatch.evidence.steady.screen import InitialCandidate, screen
from rulec.mismatch.evidence.stores.fit import Fitted as FittedStores
from rulec.mismatch.search.compete import CrossValidated, entered
from rulec.mismatch.search.free_form import _parts, _varying
from rulec.mismatch.search.latent_input import free_course, reconstruct
from rulec.mismatch.search.stores.nonparametric_term import curves
from rulec.mismatch.search.stores.searcher import Searcher
from rulec.mismatch.search.time_varying import wandering
from rulec.mismatch.search.weigh import gain_in_sample
from rulec.prove.aligned import driver_of, likeness
from rulec.prove.campaign import DRIVER
from rulec.prove.limits import CURVES_REFITTED


def at_its_place(plain: CrossValidated, places: Collection[str]) -> list[CrossValidated]:
    """Models of a settled plant with a nonparametric term at one of some places, best first."""
    fitted = plain.fitted
    here = [s for s in suspects(fitted) if f"{s.spot.module}.{s.spot.place}" in places]
    found = [entered(fitted, t) for s in here for t in _trials(fitted, s)]
    return sorted(found, key=lambda c: -gain_in_sample(c, plain))


def _trials(fitted: Fitted, place: Suspect) -> Iterator[InitialCandidate]:
    """Free courses and free curves at a place."""
    if not fitted.rows.system.data.of_rows:
        for way in (place, *wandering(fitted, place.spot)):
            if (way.weight > 0).sum() > 1:
                yield free_course(fitted, way)
    for name in _varying(fitted, place.spot.module):
        parts = _parts(fitted, name)
        pieces = [i for i in range(parts + 1) if i != parts // 2]
        features = tuple(f"{name}~{i}/{parts}" for i in pieces)
        if parts:
            curve = fitted.rows.system.builder.free_form(place.spot.id, features)
            yield from screen(fitted, [curve])[:1]


def in_its_tank(
    searcher: Searcher, plain: FittedStores, places: Collection[str]
) -> FittedStores | None:
    """The best model of a plant that stores with a free curve at one of some places."""
    spots = [s for s in searcher.bench.builder.spots if f"{s.module}.{s.place}" in places]
    tasks = curves(searcher, [plain], spots)
    drawn = searcher.refined(searcher.ranked(tasks, plain)[:CURVES_REFITTED], plain)
    return max(drawn, key=lambda f: searcher.gain(f, plain), default=None)


def course_at(folder: Path, models: Sequence[CrossValidated]) -> float | None:
    """Correlation of the best free course with the opened driver; None without either."""
    file = folder / DRIVER
    hidden = [(m, c) for m in models for c in m.fitted.setting.joined if c.sort == HIDDEN]
    if not file.exists() or not hidden:
        return None
    model, candidate = hidden[0]
    found = reconstruct(model.fitted, candidate.id)
    return likeness(found.time, found.course, *driver_of(file.read_text(encoding="utf-8")))
