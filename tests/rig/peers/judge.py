"""All peers on a rig: errors on unseen rows, and what those that name say."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rulec.prove.real.score import (
    SILENT,
    Cause,
    ScoredFinding,
    false_of,
    is_at,
    mean,
    name_right,
)
from tests.rig.peers import learnt
from tests.rig.peers.case import Case
from tests.rig.peers.catalogue import chosen
from tests.rig.peers.library import Library, libraries
from tests.rig.peers.lisdd import Discovery, discovered, regions
from tests.rig.peers.sparse import Array, one_thread, standardised
from tests.rig.peers.structure import located

LEARN = {"GP": learnt.gaussian_process, "neural": learnt.neural, "PySINDy": learnt.sparse}
STLSQ, LISDD, OURS = "catalogue STLSQ", "LISDD", "adopted"
NAMING = (STLSQ, LISDD)
MODELS = ("shipped", "recalibrated", OURS, *LEARN, *NAMING)


@dataclass(frozen=True)
class Named:
    """Names of a method: shares of what is missing with its place and its name right, and names
    that are right for nothing; None where nothing is known of the rig or nothing is missing."""

    place: float | None
    name: float | None
    false: int | None
    said: tuple[str, ...]


@dataclass(frozen=True)
class Where:
    """Places that structure leaves open: whether what is missing is among them, None where nothing
    is known or missing, and how many of all they are."""

    right: float | None
    told: int
    places: int


@dataclass(frozen=True)
class Judged:
    """A rig: errors on unseen rows by model, in `unit`, over so many `rows`; names by method."""

    rig: str
    signal: str
    unit: str
    rows: int
    errors: Mapping[str, float | None]
    names: Mapping[str, Named | None]
    where: Where | None


def judged(case: Case) -> Judged:
    """Run all peers; those that need a library do not apply to plants that store."""
    ours, nothing = case.scored, np.zeros(len(case.course.time))
    errors: dict[str, float | None] = dict.fromkeys(MODELS)
    for model, off in case.off.items():
        errors[model] = float(np.sqrt(np.mean(off[case.judged] ** 2)))
    assert np.isclose(case.error(nothing), ours.predicted[ours.signal]["recalibrated"])
    named = Named(ours.place, ours.named, len(ours.false), tuple(t.text for t in ours.said))
    names: dict[str, Named | None] = {OURS: named if ours.rig.truth else None}
    with one_thread():
        inputs = case.inputs
        for peer, learn in LEARN.items():
            errors[peer] = case.error(learn(inputs, case.course))
        if not case.stores:
            for peer, (correction, causes) in _by_terms(case).items():
                errors[peer] = case.error(correction)
                names[peer] = _named(case, causes) if ours.rig.truth else None
    known = ours.predicted[ours.signal]
    about = ours.rig.name, ours.signal, known["unit"], known["rows"]
    return Judged(*about, errors, names, _where(case))


def _where(case: Case) -> Where | None:
    found = located(case)
    if found is None:
        return None
    open_, every = found
    truth = case.scored.rig.truth
    missing = truth.missing if truth else ()
    return Where(mean(float(is_at(m, open_)) for m in missing), len(open_), every)


def _by_terms(case: Case) -> dict[str, tuple[Array, list[tuple[Cause, ...]]]]:
    """By peer, its correction of the reading that counts, and causes over all readings."""
    n = len(case.course.time)
    found: dict[str, tuple[Array, list[tuple[Cause, ...]]]] = {p: (np.zeros(n), []) for p in NAMING}
    inputs = standardised(case.drivers, case.course.learnt)
    for library in libraries(case):
        region = regions(inputs, library.course.learnt)
        everywhere = np.ones(n, dtype=bool)
        terms = {
            STLSQ: [(j, w, everywhere) for j, w in enumerate(chosen(library)) if w],
            LISDD: [(d.column, d.weight, region == d.region) for d in _local(library, region)],
        }
        for peer, own in terms.items():
            found[peer][1].extend(library.columns[j].causes for j, _, _ in own)
            if library.course.signal == case.course.signal:
                for j, weight, there in own:
                    found[peer][0][there] += weight * library.columns[j].rows[there]
    return found


def _local(library: Library, region: NDArray[np.intp]) -> list[Discovery]:
    """What is missing where, by the rows of training."""
    shown = library.course.learnt
    return discovered(library.table[shown], library.course.residual[shown], region[shown])


def _named(case: Case, causes: Iterable[tuple[Cause, ...]]) -> Named:
    """Score classes of causes as ours are, each once."""
    truth = case.scored.rig.truth
    assert truth is not None
    said = [ScoredFinding(own, 1.0, {}) for own in {own[0]: own for own in causes}.values()]
    places = [p for t in said for c in t.causes for p in c.places]
    return Named(
        mean(float(is_at(m, places)) for m in truth.missing),
        mean(name_right(m, said, "" if said else SILENT) for m in truth.missing),
        len(false_of(truth, said)),
        tuple(t.text for t in said),
    )
