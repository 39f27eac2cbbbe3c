"""Lost by the search, or not in the readings? The truth refitted, by the tool's own likelihood.

`python -m rulec.prove.refit DIR [NUMBER...]` asks again about the cases of a run that was kept in
DIR and whose answers were opened: those of which a name or a place was lost, or the ones that are
numbered. The search is run once more; then the true laws stand in its place, all values fitted
anew, and both are weighed by the tool's own likelihood and prices. Where no entry has the true law,
something without a name stands at its place (`nameless.py`).
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import terminal
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.effects.candidate import Candidate
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.evidence.steady.configuration import Setting
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.screen import screen
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.evidence.stores.record import record_of
from rulec.mismatch.evidence.stores.simulation_problem import Bench
from rulec.mismatch.search.compete import Contestant, contest, entered
from rulec.mismatch.search.periods import FEW_CHANGES, coming_and_going
from rulec.mismatch.search.search import search
from rulec.mismatch.search.stores.backward_elimination import doubted
from rulec.mismatch.search.stores.nested_models import begun_alike
from rulec.mismatch.search.stores.price import needed as needed_of_stores
from rulec.mismatch.search.stores.search import search as search_stores
from rulec.mismatch.search.stores.searcher import Searcher
from rulec.mismatch.search.weigh import gain_in_sample, needed
from rulec.prove.analyst import FORM
from rulec.prove.campaign import OPENED
from rulec.prove.judge import name_right, place_right, unnamed_right
from rulec.prove.kept import CASES
from rulec.prove.limits import CLEAR
from rulec.prove.nameless import at_its_place, course_at, in_its_tank
from rulec.prove.truth.sealed import Planted

Planned = Sequence[Planted]


@dataclass(frozen=True, kw_only=True)
class Refitted:
    """A case with the gains of the truth and of what was told, over the plain model.

    `needed` is the gain from which on anything is told; `course` the likeness of the course of a
    driver that nobody recorded, where its place is known.
    """

    case: str
    true: float
    told: float
    needed: float
    laws: tuple[str, ...]
    names: tuple[str, ...]
    course: float | None = None

    @property
    def is_in_the_readings(self) -> bool:
        """Does the truth lead by enough, and gain enough to be told?"""
        return self.true > max(self.told + CLEAR, self.needed)

    @property
    def told_in_words(self) -> str:
        """One line."""
        laws, names = ", ".join(self.laws) or "nothing", ", ".join(self.names) or "nothing"
        sign = "✗ lost by the search" if self.is_in_the_readings else "not in the readings"
        known = "" if self.course is None else f"; course at its place {self.course:.2f}"
        return (
            f"{self.case}: the truth gains {self.true:.1f} ({laws}), what was told "
            f"{self.told:.1f} ({names}), needed {self.needed:.1f}: {sign}{known}"
        )


def refitted(folder: Path) -> Refitted:
    """Ask about a case, and refit its true laws."""
    answer = json.loads((folder / OPENED).read_text(encoding="utf-8"))
    ruleset, builder = open_builder(folder / "plant")
    recording = read_recording(folder / "recording.csv", ruleset)
    ask = _stationary if ruleset.dynamics is None else _dynamic
    return ask(answer, folder, recording, ruleset, builder)


def planted_of(answer: dict[str, Any]) -> Planned:
    """Named effects of an answer."""
    return [Planted(**effect) for effect in answer["effects"] if effect["names"]]


def _right(planted: Planted, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Explanations that are right for an effect."""
    own, places = planted.module.partition(".")[0], set(planted.places)
    return [
        c
        for c in candidates
        if c.name in planted.names
        and not c.members
        and (own == c.module or f"{c.module}.{c.place}" in places)
    ]


def _places_without_a_name(answer: dict[str, Any]) -> set[str]:
    """Where something is that no entry names; none where all of it has a name."""
    if answer["verdict"] != "unnamed":
        return set()
    return {place for effect in answer["effects"] for place in effect["places"]}


def _stationary(
    answer: dict[str, Any],
    folder: Path,
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
) -> Refitted:
    data = prepare(recording, ruleset, ())
    assert data is not None
    found = search(rows_of(System(ruleset, builder, data), Setting()), _quiet)
    plain, best = found.plain, found.best.fitted
    told = contest(fit(best.rows, best.setting, best.used, temper=plain.fitted.temper), None)
    nameless = at_its_place(plain, _places_without_a_name(answer))
    planted = planted_of(answer)
    orders = (planted, planted[::-1]) if answer["verdict"] != "unnamed" else ()
    laws = [plain, *nameless[:1], *(_with(plain, order, builder) for order in orders)]
    true = max(laws, key=lambda c: gain_in_sample(c, plain))
    return Refitted(
        case=answer["case"],
        true=gain_in_sample(true, plain),
        told=gain_in_sample(told, plain),
        needed=needed(plain, len(builder.candidates)),
        laws=tuple(c.id for c in true.fitted.setting.joined),
        names=tuple(c.id for c in best.setting.joined),
        course=course_at(folder, nameless),
    )


def _with(now: Contestant, planted: Planned, builder: ModelBuilder) -> Contestant:
    """The model with the true laws, one after the other."""
    for one in planted:
        ways = [
            entered(now.fitted, trial)
            for candidate in _right(one, builder.candidates)
            for trial in (
                *screen(now.fitted, [candidate])[:1],
                *coming_and_going(now.fitted, [candidate], FEW_CHANGES),
            )
        ]
        now = max(ways, key=lambda c: gain_in_sample(c, now), default=now)
    return now


def _dynamic(
    answer: dict[str, Any],
    folder: Path,
    recording: Recording,
    ruleset: Ruleset,
    builder: ModelBuilder,
) -> Refitted:
    record = record_of(recording, ruleset, builder.given, ())
    assert record is not None
    bench = Bench(ruleset, builder, record)
    found = search_stores(bench, _quiet, 1)
    searcher, plain = Searcher(bench, found.judged, 1), found.plain
    told, _ = doubted(searcher, found)
    true = in_its_tank(searcher, plain, _places_without_a_name(answer)) or plain
    for one in planted_of(answer) if answer["verdict"] != "unnamed" else ():
        tasks = [(true, (*true.joined, c)) for c in _right(one, bench.candidates)]
        ways = [searcher.polished(searcher.trial(*task)) for task in tasks]
        if len(told.joined) == 1 and told.joined[0].onset is not None:
            # What was told may have begun at the right time.
            ids = {f.ids for f in ways}
            ways = [f for f in begun_alike(searcher, [told], ways, plain) if f.ids in ids]
        true = max(ways, key=lambda f: searcher.gain(f, plain), default=true)
    # As far as what was told, which was exchanged and fitted again.
    true = searcher.polished(true)
    return Refitted(
        case=answer["case"],
        true=searcher.gain(true, plain),
        told=searcher.gain(told, plain),
        needed=needed_of_stores(len(bench.candidates)),
        laws=true.ids,
        names=told.ids,
    )


def _quiet(what: str) -> None:
    """Nobody watches."""


def lost_in(work: Path) -> list[Path]:
    """Folders of cases of which a name, a place, or that there is no name, was lost."""
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
            named = name_right([p for p in planted if p.names], effects)
            right = min(place_right(planted, form), named)
        found += [folder] if right < 1.0 else []
    return found


def main(words: Sequence[str]) -> int:
    """Print a line for each case, and how many of them the readings do not hold."""
    work = Path(words[0])
    folders = [work / CASES / f"{int(n):04d}" for n in words[1:]] or lost_in(work)
    found, out = [], terminal()
    for folder in folders:
        one = refitted(folder)
        found.append(one)
        out.print(f"{folder.name} {one.told_in_words}")
    held = sum(one.is_in_the_readings for one in found)
    out.print(
        f"{len(found)} cases: {held} lost by the search, {len(found) - held} not in the readings"
    )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
