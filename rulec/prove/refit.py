"""Did the search lose an effect, or do the readings not hold it? Refits the true laws.

`python -m rulec.prove.refit DIR [NUMBER...]` takes the cases of a run that was kept in DIR and
whose answers were opened: those of which a name or a place was lost, or the numbered ones. It runs
the search again, then refits all parameters with the true laws in place of the answer, and compares
both by the tool's own evidence. Where no entry has the true law, a nonparametric term stands at its
place (of settled plants).

A name that the truth would win was lost by the search. Where the answer wins, the sealed strength
and margin tell on: where the best analyst would name it all the same, the tool's evidence is wrong;
else the readings do not hold it.
"""

from __future__ import annotations

import json
import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import terminal
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.effects.candidate import Candidate
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.system import system_of
from rulec.mismatch.evidence.stores.record import record_of
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.search.settled.sets import (
    Names,
    Posterior,
    explain,
    posterior,
    with_laws,
    with_terms,
)
from rulec.mismatch.search.stores.sets import explain as explain_stores
from rulec.mismatch.search.stores.sets import with_laws as with_laws_of_stores
from rulec.prove.analyst import FORM
from rulec.prove.attainable import named
from rulec.prove.campaign import OPENED
from rulec.prove.judge import name_right, place_right, unnamed_right
from rulec.prove.limits import CERTAIN, CLEAR, LIKELY
from rulec.prove.nonparametric_term import course_at
from rulec.prove.run_folder import CASES
from rulec.prove.truth.sealed import Planted

Laws = Sequence[Planted]

FOUND, SEARCH = "found by the search, not told surely", "✗ lost by the search"
EVIDENCE, READINGS = "✗ lost by the evidence", "not in the readings"
REASONS = (FOUND, SEARCH, EVIDENCE, READINGS)
"""Why a name was lost."""


@dataclass(frozen=True, kw_only=True)
class Refitted:
    """A case with the gains of the truth and of the tool's answer over the plain model.

    Attributes
    ----------
    true, reported : evidence of the true laws, and of the answer, nats over the plain model
    needed : what any answer needs
    laws, names : terms of the refitted truth, and of the answer
    at_best : chance that the best analyst names it, by the sealed strength and margin
    probability : of the true laws among all sets, had the search tried them; None where unknown
    course : correlation of the course of an unrecorded driver with the truth, at its true place
    """

    case: str
    true: float
    reported: float
    needed: float
    laws: tuple[str, ...]
    names: tuple[str, ...]
    at_best: float = 0.0
    probability: float | None = None
    course: float | None = None

    @property
    def is_lost_by_the_search(self) -> bool:
        """Does the truth lead clearly, and gain as much as an answer needs?"""
        return self.true > max(self.reported + CLEAR, self.needed)

    @property
    def reason(self) -> str:
        """Why the name was lost, one of REASONS."""
        if self.laws and set(self.laws) <= set(self.names):
            return FOUND
        if self.is_lost_by_the_search:
            return SEARCH
        return EVIDENCE if self.at_best >= LIKELY else READINGS

    @property
    def summary(self) -> str:
        """One line."""
        laws, names = ", ".join(self.laws) or "nothing", ", ".join(self.names) or "nothing"
        sure = "" if self.probability is None else f", its probability {self.probability:.2f}"
        known = "" if self.course is None else f"; course at its place {self.course:.2f}"
        return (
            f"{self.case}: the truth gains {self.true:.1f} ({laws}){sure}, the answer "
            f"{self.reported:.1f} ({names}), needed {self.needed:.1f}, at best named with "
            f"{self.at_best:.2f}: {self.reason}{known}"
        )


@dataclass(frozen=True)
class Opened:
    """A case of a kept run with its opened answer."""

    folder: Path
    answer: Mapping[str, Any]
    ruleset: Ruleset
    builder: ModelBuilder
    recording: Recording

    @property
    def laws(self) -> Laws:
        """Planted effects that an entry names; none where something else is planted, too."""
        if self.answer["verdict"] == "unnamed":
            return []
        return [Planted(**effect) for effect in self.answer["effects"] if effect["names"]]

    @property
    def at_best(self) -> float:
        """Chance that the best analyst names all that is planted."""
        each = ((float(e["gain"]), float(e["margin"])) for e in self.answer["effects"])
        return math.prod(named(*both) for both in each)

    @property
    def places_without_entry(self) -> set[str]:
        """Places of effects that no entry names; none where every effect has a name."""
        if self.answer["verdict"] != "unnamed":
            return set()
        return {place for effect in self.answer["effects"] for place in effect["places"]}


def refitted(folder: Path) -> Refitted:
    """Run the search on a case again, and refit its true laws."""
    answer = json.loads((folder / OPENED).read_text(encoding="utf-8"))
    ruleset, builder = open_builder(folder / "plant")
    recording = read_recording(folder / "recording.csv", ruleset)
    refit = _stationary if ruleset.dynamics is None else _dynamic
    return refit(Opened(folder, answer, ruleset, builder, recording))


def _right(planted: Planted, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Candidates that are right for an effect."""
    own, places = planted.module.partition(".")[0], set(planted.places)
    return [
        c
        for c in candidates
        if c.name in planted.names
        and not c.members
        and (own == c.module or f"{c.module}.{c.place}" in places)
    ]


def _stationary(case: Opened) -> Refitted:
    ruleset, builder, places = case.ruleset, case.builder, case.places_without_entry
    data = prepare(case.recording, ruleset, ())
    assert data is not None
    rows = rows_of(system_of(ruleset, builder, data), Configuration())
    found = explain(rows, _quiet)
    laws = [{c.id for c in _right(one, builder.candidates)} for one in case.laws]
    ways = [with_laws(rows, order) for order in (laws, laws[::-1])]
    ways += [with_terms(rows, places)] if places else []
    plain = found.odds[frozenset()]
    true = _of_the_truth(ways)
    tried = _beside(found, max(ways, key=lambda way: way.odds.get(true, -np.inf)), true)
    return Refitted(
        case=case.answer["case"],
        true=tried.odds[true] - plain,
        reported=found.odds[found.best] - plain,
        needed=math.log(CERTAIN / (1.0 - CERTAIN)),
        laws=tuple(sorted(true)),
        names=tuple(sorted(found.best)),
        at_best=case.at_best,
        probability=sum(p for names, p in tried.sets.items() if true <= names) if true else None,
        course=course_at(case.folder, rows, places),
    )


def _beside(found: Posterior, way: Posterior, true: Names) -> Posterior:
    """What was found, with the true laws as they were refitted."""
    odds = {**found.odds, true: way.odds[true]}
    return posterior(found.geometry, {**found.models, true: way.models[true]}, odds)


def _of_the_truth(ways: Sequence[Posterior]) -> Names:
    """The most probable set with as many of the true laws as could be refitted."""
    every = [(len(names), odds, sorted(names)) for way in ways for names, odds in way.odds.items()]
    return frozenset(max(every)[2])


def _dynamic(case: Opened) -> Refitted:
    ruleset, builder = case.ruleset, case.builder
    record = record_of(case.recording, ruleset, builder.given, ())
    assert record is not None
    bench = SimulationProblem(ruleset, builder, record)
    found = explain_stores(bench, _quiet)
    laws = [{c.id for c in _right(one, bench.candidates)} for one in case.laws]
    ways = [with_laws_of_stores(bench, order) for order in (laws, laws[::-1])]
    true = _of_the_truth(ways)
    own = max(way.odds[true] - way.odds[frozenset()] for way in ways if true in way.odds)
    return Refitted(
        case=case.answer["case"],
        true=own,
        reported=found.odds[found.best] - found.odds[frozenset()],
        needed=math.log(CERTAIN / (1.0 - CERTAIN)),
        laws=tuple(sorted(true)),
        names=tuple(sorted(found.best)),
        at_best=case.at_best,
    )


def _quiet(what: str) -> None:
    """Show no progress."""


def lost_in(work: Path) -> list[Path]:
    """Folders of cases of which the answer lacks a name or a place, or the verdict `unnamed`."""
    found = []
    for folder in sorted((work / CASES).iterdir()):
        if not all((folder / name).exists() for name in (OPENED, FORM)):
            continue
        answer = json.loads((folder / OPENED).read_text(encoding="utf-8"))
        form = json.loads((folder / FORM).read_text(encoding="utf-8"))
        planted = [Planted(**effect) for effect in answer["effects"]]
        if not planted:
            continue
        effects = form.get("effects", ())
        if answer["verdict"] == "unnamed":
            right = unnamed_right(planted, form)
        else:
            right_names = name_right([p for p in planted if p.names], effects)
            right = min(place_right(planted, form), right_names)
        found += [folder] if right < 1.0 else []
    return found


def main(words: Sequence[str]) -> int:
    """Print a line for each case, and how often a name was lost for which reason."""
    work = Path(words[0])
    folders = [work / CASES / f"{int(n):04d}" for n in words[1:]] or lost_in(work)
    found, out = [], terminal()
    for folder in folders:
        one = refitted(folder)
        found.append(one)
        out.print(f"{folder.name} {one.summary}")
    counts = Counter(one.reason for one in found)
    out.print(f"{len(found)} cases: {', '.join(f'{counts[r]} {r}' for r in REASONS)}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
