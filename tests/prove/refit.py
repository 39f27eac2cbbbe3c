"""Was a name lost by the search, or do the readings not hold it? The true laws refitted.

`python -m tests.prove.refit DIR [NUMBER...]` asks again about the cases of a run that was kept in
DIR and whose answers were opened: those of which a name was lost, or the ones that are numbered.
The search is run once more; then the true laws stand in its place, all values fitted anew, and both
are weighed by the tool's own likelihood and prices.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rulec.workshop import PlantWorkshop, open_workshop
from runtime.mismatch.candidate import Candidate
from runtime.mismatch.compete import Contestant, contest, entered
from runtime.mismatch.dynamic.bench import Bench
from runtime.mismatch.dynamic.doubt import doubted
from runtime.mismatch.dynamic.price import needed as needed_of_stores
from runtime.mismatch.dynamic.record import record_of
from runtime.mismatch.dynamic.search import search as search_stores
from runtime.mismatch.dynamic.searcher import Searcher
from runtime.mismatch.fit import fit
from runtime.mismatch.periods import FEW_CHANGES, coming_and_going
from runtime.mismatch.prepare import prepare
from runtime.mismatch.price import gain_in_sample, needed
from runtime.mismatch.rows import rows_of
from runtime.mismatch.screen import screen
from runtime.mismatch.search import search
from runtime.mismatch.setting import Setting
from runtime.mismatch.system import System
from runtime.recording import Recording, read_recording
from runtime.ruleset import Ruleset
from tests.prove.analyst import FORM
from tests.prove.campaign import OPENED
from tests.prove.judge import name_right
from tests.prove.kept import CASES
from tests.truth.sealed import Planted

CLEAR = 3.0
"""Gain in log likelihood by which the true laws must lead to be told from others: odds of 20."""

Planned = Sequence[Planted]


@dataclass(frozen=True)
class Refitted:
    """A case with the gains of the true laws and of what was told, over the plain model.

    `needed` is the gain from which on anything is told.
    """

    case: str
    true: float
    told: float
    needed: float
    laws: tuple[str, ...]
    names: tuple[str, ...]

    @property
    def is_in_the_readings(self) -> bool:
        """Do the true laws lead by enough, and gain enough to be told?"""
        return self.true > max(self.told + CLEAR, self.needed)

    @property
    def told_in_words(self) -> str:
        """One line."""
        laws, names = ", ".join(self.laws) or "nothing", ", ".join(self.names) or "nothing"
        sign = "✗ lost by the search" if self.is_in_the_readings else "not in the readings"
        return (
            f"{self.case}: true laws gain {self.true:.1f} ({laws}), what was told "
            f"{self.told:.1f} ({names}), needed {self.needed:.1f}: {sign}"
        )


def refitted(folder: Path) -> Refitted:
    """Ask about a case, and refit its true laws."""
    answer = json.loads((folder / OPENED).read_text(encoding="utf-8"))
    planted = planted_of(answer)
    ruleset, workshop = open_workshop(folder / "plant")
    recording = read_recording(folder / "recording.csv", ruleset)
    ask = _stationary if ruleset.dynamics is None else _dynamic
    return ask(answer["case"], planted, recording, ruleset, workshop)


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


def _stationary(
    case: str, planted: Planned, recording: Recording, ruleset: Ruleset, workshop: PlantWorkshop
) -> Refitted:
    data = prepare(recording, ruleset, ())
    assert data is not None
    found = search(rows_of(System(ruleset, workshop, data), Setting()), _quiet)
    plain, best = found.plain, found.best.fitted
    told = contest(fit(best.rows, best.setting, best.used, temper=plain.fitted.temper), None)
    orders = (planted, planted[::-1])
    true = max((_with(plain, o, workshop) for o in orders), key=lambda c: gain_in_sample(c, plain))
    return Refitted(
        case,
        gain_in_sample(true, plain),
        gain_in_sample(told, plain),
        needed(plain, len(workshop.candidates)),
        tuple(c.id for c in true.fitted.setting.joined),
        tuple(c.id for c in best.setting.joined),
    )


def _with(now: Contestant, planted: Planned, workshop: PlantWorkshop) -> Contestant:
    """The model with the true laws, one after the other."""
    for one in planted:
        ways = [
            entered(now.fitted, trial)
            for candidate in _right(one, workshop.candidates)
            for trial in (
                *screen(now.fitted, [candidate])[:1],
                *coming_and_going(now.fitted, [candidate], FEW_CHANGES),
            )
        ]
        now = max(ways, key=lambda c: gain_in_sample(c, now), default=now)
    return now


def _dynamic(
    case: str, planted: Planned, recording: Recording, ruleset: Ruleset, workshop: PlantWorkshop
) -> Refitted:
    record = record_of(recording, ruleset, workshop.given, ())
    assert record is not None
    bench = Bench(ruleset, workshop, record)
    found = search_stores(bench, _quiet, 1)
    searcher, plain = Searcher(bench, found.judged, 1), found.plain
    told, _ = doubted(searcher, found)
    true = plain
    for one in planted:
        tasks = [(true, (*true.joined, c)) for c in _right(one, bench.candidates)]
        ways = [searcher.polished(searcher.trial(*task)) for task in tasks]
        if len(told.joined) == 1 and told.joined[0].onset is not None:
            # What was told may have begun at the right time.
            ids = {f.ids for f in ways}
            ways = [f for f in searcher.begun_alike([told], ways, plain) if f.ids in ids]
        true = max(ways, key=lambda f: searcher.gain(f, plain), default=true)
    # As far as what was told, which was exchanged and fitted again.
    true = searcher.polished(true)
    return Refitted(
        case,
        searcher.gain(true, plain),
        searcher.gain(told, plain),
        needed_of_stores(len(bench.candidates)),
        true.ids,
        told.ids,
    )


def _quiet(what: str) -> None:
    """Nobody watches."""


def lost_in(work: Path) -> list[Path]:
    """Folders of cases of which a name was lost."""
    found = []
    for folder in sorted((work / CASES).iterdir()):
        if not all((folder / name).exists() for name in (OPENED, FORM)):
            continue
        answer = json.loads((folder / OPENED).read_text(encoding="utf-8"))
        form = json.loads((folder / FORM).read_text(encoding="utf-8"))
        planted = planted_of(answer)
        if planted and answer["verdict"] != "unnamed":
            found += [folder] if name_right(planted, form.get("effects", ())) < 1.0 else []
    return found


def main(words: Sequence[str]) -> int:
    """Print a line for each case, and how many names the readings do not hold."""
    work = Path(words[0])
    folders = [work / CASES / f"{int(n):04d}" for n in words[1:]] or lost_in(work)
    found = []
    for folder in folders:
        one = refitted(folder)
        found.append(one)
        print(f"{folder.name} {one.told_in_words}", flush=True)
    held = sum(one.is_in_the_readings for one in found)
    print(f"{len(found)} cases: {held} lost by the search, {len(found) - held} not in the readings")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
