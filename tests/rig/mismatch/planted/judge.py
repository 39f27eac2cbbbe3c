"""Ask about one planted case, and hold the answer against what is known of the true plant."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from unittest import mock

import numpy as np
from rulec_runtime.recordings.recording import Recording

from rulec.effects.candidate import TIME
from rulec.mismatch import steady
from rulec.mismatch.analyse import analyse
from rulec.mismatch.evidence.steady.predict import predictors_for
from rulec.mismatch.evidence.steady.settle import with_sensors_as_they_are
from rulec.mismatch.limits import NEEDED, WORTH
from rulec.mismatch.result import Finding, Mismatch
from rulec.mismatch.search.compete import CrossValidated
from rulec.mismatch.search.search import Search, search
from rulec.mismatch.steady import models_of, prove
from tests.rig.mismatch.planted.build import Built, drawn, opened, recorded, with_term
from tests.rig.mismatch.planted.cases import STRENGTHS, Planted
from tests.rig.mismatch.planted.course import RIGS, course
from tests.rig.mismatch.planted.truth import net, released, true_model

SAMPLES = (600, 900)

EXPECTED = {"physics": "named", "ageing": "named", "fault": "fault", "sensor": "sensor"}

AS_LIKELY = 0.25
"""Odds from which on an alternative belongs to the ambiguity set."""


@dataclass(frozen=True)
class Named:
    """A finding: its id, name, place, sort and probability; `rivals` are ids with odds."""

    id: str
    name: str
    where: str
    sort: str
    probability: float
    rivals: Mapping[str, float]

    @property
    def set_(self) -> tuple[str, ...]:
        """Ids that the answer leaves open."""
        near = [i for i, p in self.rivals.items() if p >= AS_LIKELY * self.probability]
        return (self.id, *(near if self.probability < 0.6 else ()))


@dataclass(frozen=True)
class Judged:
    """What was said of a case, and figures of the model with the truth in it.

    `sorts` are those of what was planted, `strength` what was reached. `gain` is the net gain of
    the true model over the plain one, `eased` that over the plain one with its calibration let
    go, `lead` that over the one found, all in log likelihood on blocks apart, with the prior of
    sensors and calibration. `seen` tells whether the first two are worth naming: otherwise nothing
    can be said. `inside` tells per parameter whether its interval holds the truth; `ratio` is the
    held-out error over that of the true model refitted. NaN where not known.
    """

    case: Planted
    verdict: str
    named: tuple[Named, ...]
    sorts: tuple[str, ...]
    strength: float
    gain: float
    eased: float
    lead: float
    seen: bool
    inside: tuple[bool, ...]
    ratio: float
    hidden: str
    seconds: float
    error: str = ""

    @property
    def expected(self) -> str:
        """The right verdict."""
        if self.case.kind == "clean":
            return "none"
        return "unnamed" if self.case.kind == "hidden" else EXPECTED[self.sorts[0]]

    @property
    def name_right(self) -> float:
        """Share of what was planted that is named, an ambiguity set counting 1/size."""
        if self.case.kind in ("clean", "hidden"):
            return float(self.verdict == self.expected)
        credit = [
            max((1.0 / len(n.set_) for n in self.named if id_ in n.set_), default=0.0)
            for id_ in self.case.planted
        ]
        return float(np.mean(credit))

    @property
    def place_right(self) -> float:
        """Share of the places of what was planted that are found."""
        if self.case.kind == "clean":
            return float(not self.named)
        candidates = {c.id: c for c in opened(self.case.plant)[1].candidates}
        found = {n.where for n in self.named} | {self.hidden}
        places = [candidates[i] for i in self.case.planted]
        return float(np.mean([f"{c.module}.{c.place}" in found for c in places]))

    @property
    def false_names(self) -> int:
        """Findings that are none of what was planted."""
        return sum(not set(self.case.planted) & set(n.set_) for n in self.named)


def judge(case: Planted) -> Judged:
    """Make the recording and analyse it; an exception counts as an answer of its own."""
    begin = time.perf_counter()
    random = np.random.default_rng(case.seed)
    built, strength = built_of(case, random)
    sorts = tuple(c.sort for c in built.joined)
    recording = recorded(built, random, case.without)
    try:
        found, behind = analysed(case.plant, recording)
    except Exception as failure:  # a bug of the tool is a result here
        error = f"{type(failure).__name__}: {failure}"
        nan = float("nan")
        return Judged(
            case, "failed", (), sorts, strength, nan, nan, nan, True, (), nan, "",
            time.perf_counter() - begin, error,
        )  # fmt: skip
    gain = eased = lead = ratio = float("nan")
    seen = True
    if behind is not None and case.kind not in ("clean", "hidden", "periods"):
        true = true_model(behind.plain, built)
        gain = net(true, behind.plain)
        eased = net(true, released(behind.plain, true)) if true.fitted.setting.released else gain
        worth = NEEDED + WORTH * true.fitted.rows.groups
        seen = gain > worth + float(np.log(max(behind.tried, 1))) and eased > worth
        lead = net(true, behind.best)
        ratio = _ratio(found, true)
    return Judged(
        case,
        found.verdict,
        tuple(_named(f) for f in found.findings),
        sorts,
        strength,
        gain,
        eased,
        lead,
        seen,
        _inside(found, built) if case.kind != "periods" else (),
        ratio,
        f"{found.hidden.module}.{found.hidden.place}" if found.hidden else "",
        time.perf_counter() - begin,
    )


def built_of(case: Planted, random: np.random.Generator) -> tuple[Built, float]:
    """The true plant of a case, and the least strength of what is built in."""
    samples = int(random.integers(*SAMPLES))
    given = {**course(RIGS[case.plant], samples, random), TIME: np.arange(samples, dtype=float)}
    built = Built(case.plant, (), drawn(case.plant, random), given)
    candidates = {c.id: c for c in opened(case.plant)[1].candidates}
    reached = []
    for name in case.planted:
        built, strength = with_term(built, candidates[name], STRENGTHS[case.strength], random)
        reached.append(strength)
    if case.kind == "periods":
        built = _coming_and_going(built, samples, random)
    return built, min(reached, default=0.0)


def _coming_and_going(built: Built, samples: int, random: np.random.Generator) -> Built:
    """The degree of a fault in two or three periods only."""
    unknown = built.joined[0].unknowns[0]
    there = np.zeros(samples)
    parts = int(random.integers(2, 4))
    for i in range(parts):
        first = int((i + random.uniform(0.1, 0.5)) * samples / parts)
        there[first : first + int(random.uniform(0.1, 0.15) * samples)] = 1.0
    degree = built.values[unknown.id]
    values = {n: v for n, v in built.values.items() if n != unknown.id}
    return replace(built, values=values, given={**built.given, unknown.id: degree * there})


def analysed(plant: str, recording: Recording) -> tuple[Mismatch, Search | None]:
    """The answer, and the search behind it; None where it did not come to that."""
    kept: list[Search] = []

    def keeping(*arguments: object) -> Search:
        kept.append(search(*arguments))  # type: ignore[arg-type]
        return kept[-1]

    ruleset, builder = opened(plant)
    with mock.patch.object(steady, "search", keeping):
        found = analyse(recording, ruleset, builder)
    return found, kept[-1] if kept else None


def _ratio(found: Mismatch, true: CrossValidated) -> float:
    """Held-out error over that of the true model, of the first predicted signal."""
    if found.fit is None:
        return float("nan")
    system = true.fitted.rows.system
    joined = true.fitted.setting.joined
    places = [(c.observers, frozenset(c.drivers.values()), "") for c in joined]
    places += [(tuple(o.id for o in system.observers), frozenset(), "")]
    models = models_of(with_sensors_as_they_are(true.fitted))
    for predictor in (p for place in places for p in predictors_for(system, *place)):
        if predictor.signal.id == found.fit.signal:
            error = prove(predictor, models).fit.heldout.repaired
            return found.fit.heldout.repaired / error if error > 0 else float("nan")
    return float("nan")


def _named(finding: Finding) -> Named:
    return Named(
        finding.id,
        finding.name,
        f"{finding.module}.{finding.place}",
        finding.sort,
        finding.probability,
        {a.id: a.probability for a in finding.alternatives},
    )


def _inside(found: Mismatch, built: Built) -> tuple[bool, ...]:
    """Whether intervals hold the truth, per parameter of what was named rightly."""
    inside = []
    for finding in found.findings:
        candidate = next((c for c in built.joined if c.id == finding.id), None)
        for unknown in candidate.unknowns if candidate is not None else ():
            if not unknown.fixed and unknown.name in finding.parameters:
                estimate = finding.parameters[unknown.name]
                value = (built.values[unknown.id] - unknown.offset) / unknown.factor
                inside.append(bool(estimate.lower <= value <= estimate.upper))
    return tuple(inside)
