"""The result of each of several recordings alone, and the change by each further one.

Each time the search runs on the rows of some recordings. Reusing the sets found on all rows would
be cheaper and wrong: a set that a later recording refutes would have been refitted to its rows too,
with the noise and errors of form that this needs, and would seem refuted before.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from rulec_runtime.recordings.join_recordings import part_of
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.text import listed

from rulec.effects.candidate import TIME
from rulec.mismatch import limits as common
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import Rows, rows_of
from rulec.mismatch.evidence.steady.system import System, system_of
from rulec.mismatch.result import Likely, Moved
from rulec.mismatch.search import limits
from rulec.mismatch.search.settled.best_set import titled_with_module
from rulec.mismatch.search.settled.grow_sets import Posterior, Progress, explain
from rulec.mismatch.search.settled.scan import id_of, name_of

NOTHING = "nothing"
"""Id of the empty set of explanations."""

TERM = "~"
"""Mark before the driver in the name of a term without a name."""

SORTED = {"physics": "named", "ageing": "named", "fault": "fault", "sensor": "sensor"}
"""Verdict by the sort of the only certain explanation."""


@dataclass(frozen=True)
class SingleRecording:
    """The result of one recording, by its number, alone."""

    number: int
    verdict: str
    likely: tuple[Likely, ...]


@dataclass(frozen=True)
class ByRecording:
    """The result of each recording alone, and how the second and each later one, by its number,
    moved probabilities."""

    alone: tuple[SingleRecording, ...]
    moved: Mapping[int, tuple[Moved, ...]]


def by_recording(
    recording: Recording,
    system: System,
    heldout: Sequence[tuple[float, float]],
    posterior: Posterior,
    progress: Progress,
) -> ByRecording | None:
    """Search each recording alone, and the first few together; None for a single recording.

    `posterior` is that of all recordings.
    """
    count = len(recording.sources)
    if count < 2:
        return None
    known: dict[frozenset[int], Posterior | None] = {frozenset(range(count)): posterior}

    def on(numbers: Collection[int]) -> Posterior | None:
        chosen = frozenset(numbers)
        if chosen not in known:
            progress(f"searching {listed([recording.sources[i] for i in sorted(chosen)])} alone")
            rows = _rows_of(part_of(recording, chosen), system, heldout)
            known[chosen] = explain(rows, lambda text: None) if rows is not None else None
        return known[chosen]

    each = tuple(SingleRecording(number, *_result(on({number}))) for number in range(count))
    moved = {n: _moved(on(range(n)), on(range(n + 1))) for n in range(1, count)}
    return ByRecording(each, moved)


def _rows_of(
    recording: Recording, system: System, heldout: Sequence[tuple[float, float]]
) -> Rows | None:
    """Rows of some recordings; None where there are too few."""
    data = prepare(recording, system.ruleset, heldout)
    if data is None or int(data.open.sum()) < common.FEWEST_POINTS:
        return None
    rows = rows_of(system_of(system.ruleset, system.builder, data), Configuration())
    return rows if rows.groups >= common.FEWEST_POINTS else None


def _result(found: Posterior | None) -> tuple[str, tuple[Likely, ...]]:
    """The verdict by probabilities only, and the likely explanations, the likeliest first."""
    if found is None:
        return "cannot judge", ()
    every, (titles, sorts) = _by_id(found), _titles(found)
    kept = sorted((k for k, p in every.items() if p >= common.MENTIONED), key=lambda k: -every[k])
    return _verdict(every, sorts), tuple(Likely(key, titles[key], every[key]) for key in kept)


def _key(name: str) -> str:
    """One key for a fault with any course, and for terms without a name over one driver."""
    _, mark, driver = name.rpartition(TERM)
    return TERM + driver if mark else id_of(name)


def _by_id(posterior: Posterior) -> dict[str, float]:
    """Probability of each explanation, by its id; as in a finding, that errors of laws and sensors
    alone explain the misfit counts against those of the best set."""
    found = {NOTHING: posterior.sets.get(frozenset(), 0.0)}
    for names, probability in posterior.sets.items():
        for key in {_key(name) for name in names}:
            found[key] = found.get(key, 0.0) + probability
    exact = posterior.tolerance.stand_out
    return {k: p * (1.0 - limits.INEXACT * (1.0 - exact.get(k, 1.0))) for k, p in found.items()}


def _titles(posterior: Posterior) -> tuple[dict[str, str], dict[str, str]]:
    """Titles and sorts of all explanations by their ids."""
    titles = {NOTHING: "nothing left out"}
    sorts = {NOTHING: "none"}
    for names, model in posterior.models.items():
        for candidate in model.setting.joined:
            key, title = _key(name_of(model.setting, candidate)), titled_with_module(candidate)
            lower = title[:1].lower() + title[1:] if title[1:2].islower() else title
            titles[key], sorts[key] = lower, candidate.sort
        for key in (_key(name) for name in names if TERM in name):
            driver = key.removeprefix(TERM)
            follows = "time" if driver == TIME else driver
            titles[key], sorts[key] = f"something without a name over {follows}", "free"
    return titles, sorts


def _verdict(found: Mapping[str, float], sorts: Mapping[str, str]) -> str:
    if found[NOTHING] >= limits.LIKELIER:
        return "none"
    best = max(found.keys() - {NOTHING}, key=lambda key: (found[key], key))
    sort = SORTED.get(sorts[best], "unnamed")
    return "ambiguous" if sort != "unnamed" and found[best] < common.CERTAIN else sort


def _moved(before: Posterior | None, after: Posterior | None) -> tuple[Moved, ...]:
    """Probabilities before and after of explanations that are likely in either; None before the
    first recording that could be judged."""
    titles: dict[str, str] = {}
    shares: list[dict[str, float]] = []
    for found in (before, after):
        shares.append({} if found is None else _by_id(found))
        titles |= {} if found is None else _titles(found)[0]
    first, last = shares
    every = {k: (first.get(k, 0.0 if first else None), last.get(k, 0.0)) for k in first | last}
    largest = {key: max(old or 0.0, new) for key, (old, new) in every.items()}
    kept = [key for key, share in largest.items() if share >= common.MENTIONED]
    kept.sort(key=lambda key: (-largest[key], key))
    return tuple(Moved(key, titles[key], *every[key]) for key in kept)
