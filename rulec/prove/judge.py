"""Compares the tool's answer with the sealed one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rulec.prove.aligned import TIME, Course, columns_of, courses_of, likeness
from rulec.prove.analyst import SERIES
from rulec.prove.baselines import Baselines, dynamic_baselines, stationary_baselines
from rulec.prove.limits import CERTAIN, COVERAGE_OF_DEGREES, MENTIONED
from rulec.prove.results import Claim, Heldout, Judged
from rulec.prove.truth.sealed import Answer, Case, Planted, Reference, Request

NAN = float("nan")
ERRORS = ("shipped", "recalibrated", "repaired", "noise")
Form = Mapping[str, Any]


def judge(case: Case, form: Form, folder: Path, partition: str) -> tuple[Judged, bool]:
    """Score a case; second: did the simulation of a baseline run away?"""
    answer, fit = case.answer, form.get("fit")
    known = _reference(case, form) if answer.effects and fit else Reference({})
    baselines = _baselines(answer, fit, folder) if answer.effects and fit else None
    said = judged_words(answer, form, partition)
    judged = replace(
        said,
        ratio=_ratio(form, known, said.verdict),
        course=_course(known, form, folder) if answer.unrecorded else None,
        baselines=baselines.ratios if baselines else {},
    )
    return judged, bool(baselines and baselines.ran_away)


def judged_words(answer: Answer, form: Form, partition: str) -> Judged:
    """Scores of what is said, without those of a course or a prediction."""
    effects = list(form.get("effects", ()))
    verdict = form.get("verdict", "failed")
    named = [p for p in answer.effects if p.names]
    asked = bool(named) and answer.verdict != "unnamed"
    return Judged(
        case=answer.case,
        half=answer.half,
        plant=answer.plant,
        profile=answer.profile,
        partition=partition,
        verdict_true=answer.verdict,
        verdict=verdict,
        concealed=answer.concealed,
        planted=tuple(f"{p.effect}@{p.module}" for p in answer.effects),
        places=tuple(dict.fromkeys(place for p in answer.effects for place in p.places)),
        said=tuple(f"{e['effect']}@{e['module']}.{e['place']}" for e in effects),
        gain=sum(p.gain for p in answer.effects),
        margin=min((p.margin for p in answer.effects), default=float("inf")),
        digest=answer.digest,
        place_right=place_right(answer.effects, form) if answer.effects else None,
        name_right=name_right(named, effects) if asked else None,
        clean_right=None if answer.effects else float(verdict == "none"),
        unnamed_right=(
            unnamed_right(answer.effects, form) if answer.verdict == "unnamed" else None
        ),
        told_right=_told(answer, verdict),
        inside=_inside(named, effects),
        claims=_claims(named, effects),
        errors=_errors(form.get("fit")),
        seconds=float(form.get("seconds", NAN)),
        error=str(form.get("error", "")),
        difficulties=tuple(answer.difficulties),
    )


def _set_of(effect: Form) -> list[tuple[str, str]]:
    """Names that a finding tells, its own first, each with its id."""
    names = [(str(effect["effect"]), str(effect["id"]))]
    if (effect["probability"] or 0.0) < CERTAIN:
        others = (a for a in effect["alternatives"] if a["probability"] >= MENTIONED)
        names += [(str(a["effect"]), str(a["id"])) for a in others]
    return names


def _is(planted: Planted, effect: Form) -> float:
    """Share of the names left open that are right, in the right module or at an equivalent place.

    1/n of n, and more where the key has several names for the same in this plant.
    """
    open_, right = _set_of(effect), 0
    for name, id_ in open_:
        modules = {id_.partition(".")[0], *(effect["modules"] if id_ == effect["id"] else ())}
        at = {f"{m}.{effect['place']}" for m in modules}
        here = planted.module.partition(".")[0] in modules or bool(at & set(planted.places))
        right += name in planted.names and here
    return right / len(open_)


def is_named(planted: Planted, effect: Form) -> bool:
    """Is the name of a finding, whatever it leaves open beside it, right?"""
    return _is(planted, {**effect, "alternatives": (), "probability": 1.0}) == 1.0


def _claims(planted: Sequence[Planted], effects: Sequence[Form]) -> tuple[Claim, ...]:
    """Every name with the probability that it was told with; a free curve is no name."""
    names = [e for e in effects if e.get("sort") != "free" and e["probability"] is not None]
    return tuple(
        Claim(float(e["probability"]), any(is_named(p, e) for p in planted)) for e in names
    )


def _credit(planted: Planted, effects: Sequence[Form]) -> float:
    """The best share of any finding."""
    return max((_is(planted, e) for e in effects), default=0.0)


def name_right(planted: Sequence[Planted], effects: Sequence[Form]) -> float:
    """Share of effects named rightly; each false name besides lowers it."""
    credit = sum(_credit(p, effects) for p in planted)
    return float(credit / max(len(planted), len(effects)))


def _said_places(form: Form) -> set[str]:
    """All places in an answer."""
    places = [*form.get("effects", ()), *form.get("locations", ())]
    hidden = form.get("hidden_driver")
    found = {f"{e['module']}.{e['place']}" for e in [*places, *([hidden] if hidden else [])]}
    if not form.get("effects"):
        # What has no name and may be at one of several places is one thing, told at the first.
        found |= {place for e in form.get("locations", ()) for place in e.get("also", ())}
    for effect in form.get("effects", ()):
        found |= {f"{m}.{effect['place']}" for m in effect["modules"]}
    return found


def place_right(planted: Sequence[Planted], form: Form) -> float:
    """Share of effects with the right place.

    What is named rightly has its place; one of several names left open counts as much as its name.
    """
    said, effects = _said_places(form), form.get("effects", ())
    right = [
        1.0 if said & set(p.places) else _credit(p, effects) if p.names else 0.0 for p in planted
    ]
    return float(np.mean(right))


def unnamed_right(planted: Sequence[Planted], form: Form) -> float:
    """1 if the verdict is `unnamed` and a place is right, else 0."""
    return float(form.get("verdict") == "unnamed" and place_right(planted, form) > 0)


def _told(answer: Answer, verdict: str) -> bool | None:
    """Is fault or sensor error told from physics? None where the tool named nothing."""
    sorts = {p.sort for p in answer.effects}
    if verdict not in ("named", "fault", "sensor") or not sorts or "unnamed" in sorts:
        return None
    if sorts == {"physics"} and answer.verdict != "unnamed":
        return verdict == "named"
    return verdict in ("fault", "sensor") if "physics" not in sorts else None


def _inside(planted: Sequence[Planted], effects: Sequence[Form]) -> tuple[int, int]:
    """Number of intervals that hold the truth, and of all, for what was named rightly."""
    hits = count = 0
    for p in planted:
        for effect in effects:
            if not is_named(p, effect):
                continue
            for name, value in p.parameters.get(effect["effect"], {}).items():
                estimate = _estimate(effect, name)
                if estimate is not None:
                    count += 1
                    hits += bool(estimate[0] <= value <= estimate[1])
    return hits, count


def _estimate(effect: Form, name: str) -> tuple[float, float] | None:
    """Interval of a parameter; of a fault in periods, that of its degree."""
    found = effect["parameters"].get(name)
    if found is not None and found.get("lower") is not None and found.get("upper") is not None:
        return float(found["lower"]), float(found["upper"])
    periods = effect.get("periods") or []
    if periods and periods[0].get("u") is not None:
        degree, u = float(periods[0]["degree"]), float(periods[0]["u"])
        return degree - COVERAGE_OF_DEGREES * u, degree + COVERAGE_OF_DEGREES * u
    return None


def _request(form: Form) -> Request:
    spans = tuple((float(a), float(b)) for a, b in form["split"]["heldout"])
    return Request(spans, {f["signal"]: f["relation"] for f in form["fits"] if f["relation"]})


def _reference(case: Case, form: Form) -> Reference:
    """The true model on what the tool held out; empty where it has no solution."""
    try:
        return case.reference(_request(form))
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return Reference({})


def _ratio(form: Form, known: Reference, verdict: str) -> float | None:
    """Held-out error over the true model's, of the first signal; None without a repair."""
    fit = form.get("fit")
    if not fit or verdict not in ("named", "ambiguous", "fault", "sensor"):
        return None
    error = known.errors.get(fit["signal"], NAN)
    # The true model knows faults and sensors too: it is compared with the whole explanation.
    held = fit["heldout"]
    repaired = held["repaired"] if held.get("explained") is None else held["explained"]
    if repaired is None or not error > 0:
        return None
    return float(repaired) / error


def _course(known: Reference, form: Form, folder: Path) -> float:
    """Correlation of the reconstructed course with the truth; 0 where there is no course."""
    hidden = form.get("hidden_driver")
    if not hidden or not hidden.get("series") or known.driver is None:
        return 0.0
    columns = columns_of((folder / hidden["series"]).read_text(encoding="utf-8"))
    course = next(v for header, v in columns.items() if header.startswith("course"))
    return likeness(columns[TIME], course, *known.driver)


def _errors(fit: Form | None) -> Heldout | None:
    if not fit:
        return None
    held = fit["heldout"]
    return Heldout(**{name: NAN if held[name] is None else float(held[name]) for name in ERRORS})


def _baselines(answer: Answer, fit: Form, folder: Path) -> Baselines | None:
    """The baselines on the same held-out samples."""
    file = folder / SERIES
    if not file.exists():
        return None
    courses: list[Course] = courses_of(file.read_text(encoding="utf-8"))
    course = next((c for c in courses if c.signal == fit["signal"]), None)
    if course is None or not course.judged.any():
        return None
    columns = columns_of((folder / "recording.csv").read_text(encoding="utf-8"))
    if answer.half == "stationary":
        return stationary_baselines(columns, course)
    inputs = [h for h in columns if h != TIME and not _is_output(columns[h], courses)]
    return dynamic_baselines(columns, course, inputs)


def _is_output(values: np.ndarray, courses: Sequence[Course]) -> bool:
    """Is a column one of the predicted readings?"""
    return any(
        len(values) == len(c.measured) and np.allclose(values, c.measured, equal_nan=True)
        for c in courses
    )
