"""Beside a detector that learns from examples: gradient boosted trees of scikit-learn.

Both judge the same simulated episodes of plant abc: true plants whose parameters, laws and sensors
are off within their uncertainties, none of which the detector saw. It is taught the means of an
episode's readings at two degrees, and asked at those, at a degree between, and about a plant with
the same columns whose second pump feeds elsewhere. Ours is told the plant file, and no example.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rulec_runtime.contract.plan import Array

from rulec.passes.perturb import true_plan
from rulec.passes.pipeline import run_passes
from rulec.passes.types import Compilation
from rulec.simulation.equations import equations_of
from rulec.study.campaign import Settings, generator, groups_of, record
from rulec.study.judge import Kind, judge
from rulec.study.points import operating_points
from tests.bench.row import Row
from tests.conftest import ROOT

ABC = ROOT / "plants" / "abc"
TAUGHT, BETWEEN = (0.1, 0.3), 0.2
LESSONS, ASKED = 8, 1
"""True plants of each fault that are learnt from, and that are asked about."""
POINTS, HEALTHY, FIRST_ASKED = 3, 10, 1000


@dataclass(frozen=True)
class Episode:
    """Readings of an episode by signal, SI; the fault and its degree."""

    fault: str
    degree: float
    readings: dict[str, Array]


@dataclass(frozen=True)
class Score:
    """Shares of faulty episodes named right and of healthy ones accused; CPU time of each, s."""

    right: float
    alarms: float
    each: float


def rows() -> list[Row]:
    """Three exams of both."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    known = run_passes(Compilation(path=ABC))
    lessons = episodes(known, TAUGHT, range(LESSONS))
    names = sorted(lessons[0].readings)
    begin = time.process_time()
    detector = HistGradientBoostingClassifier(max_iter=60, random_state=0)
    detector.fit(features(lessons, names), [e.fault for e in lessons])
    teaching = time.process_time() - begin
    asked = range(FIRST_ASKED, FIRST_ASKED + ASKED)
    with tempfile.TemporaryDirectory() as folder:
        other = run_passes(Compilation(path=rewired(Path(folder))))
    found = []
    for key, what, models, degrees in (
        ("seen", "degrees that were taught", known, TAUGHT),
        ("degree", f"degree {BETWEEN:g}, which was not taught", known, (BETWEEN,)),
        ("topology", "the second pump feeds elsewhere", other, TAUGHT),
    ):
        exam = episodes(models, degrees, asked)
        ours, theirs = by_rules(models, exam), by_detector(detector, exam, names)
        found.append(
            Row(
                key=f"learned-{key}",
                what=f"episodes of abc: {what}",
                peer="gradient boosted trees",
                ours=ours.each,
                theirs=theirs.each,
                same=f"{len(exam)} episodes of plants that neither has seen; right "
                f"{ours.right:.0%} here, {theirs.right:.0%} there; healthy ones accused "
                f"{ours.alarms:.0%}, {theirs.alarms:.0%}",
                differs=f"taught with {len(lessons)} episodes ({teaching:.0f} s) there; equations "
                "and no example here, with degree, bounds and evidence",
                more={
                    "right": ours.right,
                    "right-there": theirs.right,
                    "alarms": ours.alarms,
                    "alarms-there": theirs.alarms,
                    "episodes": len(exam),
                    "lessons": len(lessons),
                },
            )
        )
    return found


def rewired(folder: Path) -> Path:
    """The plant abc, where only its first pump feeds the mixer."""
    data: dict[str, Any] = yaml.safe_load((ABC / "plant.yaml").read_text(encoding="utf-8"))
    data["connections"] = [c for c in data["connections"] if not str(c).startswith("B ")]
    data.pop("columns", None)
    (folder / "plant.yaml").write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return folder


def episodes(models: Compilation, degrees: Sequence[float], seeds: range) -> list[Episode]:
    """Of all faults at all degrees and points, and healthy ones."""
    rules = models.ruleset
    faults = [f.id for f in rules.faults]
    settings = Settings(degrees=tuple(degrees), points=POINTS, seeds=1, healthy=HEALTHY)
    points = operating_points(equations_of(rules), POINTS)

    def drawn(random: np.random.Generator) -> Any:
        return true_plan(models, faults, random)

    found = []
    for group in groups_of(rules, settings, drawn):
        for seed in seeds:
            own = _seeded(group, seed, drawn)
            for degree, readings in record(rules, points, settings, own):
                if readings is not None:
                    found.append(Episode(own.fault, degree, readings))
    return found


def _seeded(group: Any, seed: int, drawn: Any) -> Any:
    """The same fault on another true plant."""
    random = generator(0, group.fault, seed, group.draw)
    return replace(group, seed=seed, truth=drawn(random))


def features(episodes: Sequence[Episode], names: Sequence[str]) -> Array:
    """Means of readings, shape (episodes, signals)."""
    return np.array([[float(e.readings[n].mean()) for n in names] for e in episodes])


def by_rules(models: Compilation, exam: Sequence[Episode]) -> Score:
    """Named first; a healthy one is accused where anything is."""
    begin = time.process_time()
    told = [judge(models.ruleset, e.readings, e.fault, e.degree, 0, "default") for e in exam]
    each = (time.process_time() - begin) / len(exam)
    right = [o.kind is Kind.NAMED for e, o in zip(exam, told, strict=True) if e.fault]
    accused = [o.kind is Kind.OTHER for e, o in zip(exam, told, strict=True) if not e.fault]
    return Score(float(np.mean(right)), float(np.mean(accused)), each)


def by_detector(detector: Any, exam: Sequence[Episode], names: Sequence[str]) -> Score:
    """The class of the largest probability."""
    begin = time.process_time()
    told = detector.predict(features(exam, names))
    each = (time.process_time() - begin) / len(exam)
    right = [e.fault == name for e, name in zip(exam, told, strict=True) if e.fault]
    accused = [bool(name) for e, name in zip(exam, told, strict=True) if not e.fault]
    return Score(float(np.mean(right)), float(np.mean(accused)), each)
