"""Peers beside ours on real rigs, as JSON: `python -m tests.rig.peers RIGS KEPT`.

RIGS is a folder of rigs, KEPT what `rulec prove --real RIGS --keep KEPT` left. Errors: root mean
square of the reading that counts on rows that were never shown; adopted is ours; null does not
apply.
"""

import argparse
import dataclasses
import json
import math
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rulec.prove.campaign import CASES
from rulec.prove.real.rig_folder import rigs_in
from rulec.prove.real.score import SILENT, Cause, ScoredFinding, false_of, is_at, mean, name_right
from tests.rig.peers import learnt
from tests.rig.peers.case import Case, Library, case_of, chosen, libraries, located
from tests.rig.peers.learnt import Array, Discovery, discovered, one_thread, regions
from tests.rig.peers.limits import NEAR_BEST

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
    inputs = learnt.standardised(case.drivers, case.course.learnt)
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


NEEDED = ("sklearn", "pysindy")


def summary(found: Sequence[Judged]) -> dict[str, Any]:
    """Rigs on which ours is best or near it, and geometric means over rigs that have a model."""
    models = []
    for model in MODELS[2:]:
        there = [j for j in found if j.errors[model] is not None]
        means = {"over recalibrated": _mean(there, model), "ours there": _mean(there, OURS)}
        models.append({"model": model, **means, "rigs": len(there)})
    return {"best": sum(_best(j, 1.0) for j in found), "near": sum(_best(j) for j in found)} | {
        "rigs": len(found),
        "models": models,
    }


def _best(j: Judged, near: float = NEAR_BEST) -> bool:
    ours = j.errors[OURS]
    return ours is not None and ours <= near * min(e for e in j.errors.values() if e is not None)


def _mean(found: Sequence[Judged], model: str) -> float | None:
    """Geometric mean of errors over those of recalibration."""
    pairs = [(j.errors[model], j.errors["recalibrated"]) for j in found]
    logs = [math.log(a / b) for a, b in pairs if a and b]
    return math.exp(sum(logs) / len(logs)) if logs else None


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.rig.peers", description=__doc__)
    parser.add_argument("rigs", type=Path)
    parser.add_argument("kept", type=Path)
    parser.add_argument("--only", default="", help="rigs whose name holds this")
    options = parser.parse_args()
    lacking = [name for name in NEEDED if find_spec(name) is None]
    if lacking:
        parser.error(f"{', '.join(lacking)} not installed; pip install '.[prove]'")
    found = []
    with tempfile.TemporaryDirectory(prefix="rulec-peers-") as work:
        for number, rig in enumerate(rigs_in(options.rigs)):
            if options.only in rig.name:
                print(rig.name, file=sys.stderr)
                case = case_of(rig, options.kept / CASES / f"{number:04d}", Path(work))
                found += [] if case is None else [judged(case)]
    rigs = {j.rig: dataclasses.asdict(j) for j in found}
    print(json.dumps({"summary": summary(found), "rigs": rigs}, indent=1))


if __name__ == "__main__":
    main()
