"""Compares the tool's answer with the sealed one."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rulec.prove.limits import CERTAIN, COVERAGE_OF_DEGREES, FEWEST_IN_A_COURSE, MENTIONED
from rulec.prove.results import Claim, Heldout, Judged
from rulec.prove.truth.sealed import Answer, Case, Planted, Reference, Request

Array = NDArray[np.float64]

TIME = "time [s]"
NAN = float("nan")


def columns_of(text: str) -> dict[str, Array]:
    """Read a CSV table as columns by header; NaN in cells without a number."""
    head, *rows = csv.reader(io.StringIO(text))

    def number(cell: str) -> float:
        try:
            return float(cell)
        except ValueError:
            return NAN

    columns = {name: [number(row[i]) for row in rows] for i, name in enumerate(head)}
    return {name: np.array(cells, dtype=float) for name, cells in columns.items()}


def likeness(time: Array, course: Array, clock: Array, driver: Array) -> float:
    """Return the absolute correlation of a reconstructed course with the truth; 0 without one.

    `time` and `course` have shape (n,), `clock` and `driver` shape (m,).
    """
    usable = np.isfinite(course)
    truth = np.interp(time[usable], clock, driver)
    if usable.sum() < FEWEST_IN_A_COURSE or np.std(course[usable]) == 0 or np.std(truth) == 0:
        return 0.0
    return float(abs(np.corrcoef(course[usable], truth)[0, 1]))


ERRORS = ("shipped", "recalibrated", "repaired", "noise")
Form = Mapping[str, Any]


def judge(case: Case, form: Form, folder: Path, partition: str) -> Judged:
    """Score a case."""
    answer, fit = case.answer, form.get("fit")
    known = _reference(case, form) if answer.effects and fit else Reference({})
    said = judged_words(answer, form, partition)
    return replace(
        said,
        ratio=_ratio(form, known, said.verdict),
        course=_course(known, form, folder) if answer.unrecorded else None,
    )


def judged_words(answer: Answer, form: Form, partition: str) -> Judged:
    """Score the reported effects, without the scores of a course or a prediction."""
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
            float(verdict == "unnamed" and place_right(answer.effects, form) > 0)
            if answer.verdict == "unnamed"
            else None
        ),
        told_right=_is_sort_right(answer, verdict),
        inside=_inside(named, effects),
        claims=_claims(named, effects),
        errors=_errors(form.get("fit")),
        seconds=float(form.get("seconds", NAN)),
        error=str(form.get("error", "")),
        difficulties=tuple(answer.difficulties),
    )


def class_probability(effect: Form) -> float:
    """Return the probability of a finding together with those that coincide with it."""
    return float(effect.get("class_probability") or effect["probability"] or 0.0)


def _candidates(effect: Form) -> list[tuple[str, str]]:
    """Names and ids that a finding leaves open, its own first."""
    names = [(str(effect["effect"]), str(effect["id"]))]
    if (effect["probability"] or 0.0) < CERTAIN:
        others = (a for a in effect["alternatives"] if a["probability"] >= MENTIONED)
        names += [(str(a["effect"]), str(a["id"])) for a in others]
    return names


def _share_right(planted: Planted, effect: Form) -> float:
    """Share of the candidates that are right, in the right module or at an equivalent place.

    It is 1/n of n candidates, and more if the key has several names for the effect in this plant.
    """
    candidates, right = _candidates(effect), 0
    for name, id_ in candidates:
        modules = {id_.partition(".")[0], *(effect["modules"] if id_ == effect["id"] else ())}
        at = {f"{m}.{effect['place']}" for m in modules}
        here = planted.module.partition(".")[0] in modules or bool(at & set(planted.places))
        right += name in planted.names and here
    return right / len(candidates)


def is_named(planted: Planted, effect: Form) -> bool:
    """Return whether the name of a finding is right, whatever else it leaves open."""
    return _share_right(planted, {**effect, "alternatives": (), "probability": 1.0}) == 1.0


def _claims(planted: Sequence[Planted], effects: Sequence[Form]) -> tuple[Claim, ...]:
    """Every reported name with its probability; a free curve is no name."""
    names = [e for e in effects if e.get("sort") != "free" and e["probability"] is not None]
    return tuple(
        Claim(float(e["probability"]), any(is_named(p, e) for p in planted)) for e in names
    )


def _credit(planted: Planted, effects: Sequence[Form]) -> float:
    return max((_share_right(planted, e) for e in effects), default=0.0)


def name_right(planted: Sequence[Planted], effects: Sequence[Form]) -> float:
    """Return the share of effects named correctly; false names beyond their number lower it."""
    credit = sum(_credit(p, effects) for p in planted)
    return float(credit / max(len(planted), len(effects)))


def _reported_places(form: Form) -> set[str]:
    effects, locations = form.get("effects", ()), form.get("locations", ())
    hidden = form.get("hidden_driver")
    parts = [*effects, *locations, *([hidden] if hidden else [])]
    found = {f"{e['module']}.{e['place']}" for e in parts}
    if not effects:
        # A term without a name that may be at several places is reported at the first of them.
        found |= {place for e in locations for place in e.get("also", ())}
    return found | {f"{m}.{e['place']}" for e in effects for m in e["modules"]}


def place_right(planted: Sequence[Planted], form: Form) -> float:
    """Return the share of effects with the right place.

    A correctly named effect has its place; one of several candidates counts as much as its name.
    """
    reported, effects = _reported_places(form), form.get("effects", ())
    right = [
        1.0 if reported & set(p.places) else _credit(p, effects) if p.names else 0.0
        for p in planted
    ]
    return float(np.mean(right))


def _is_sort_right(answer: Answer, verdict: str) -> bool | None:
    """Whether a fault or sensor error is distinguished from physics; None if nothing was named."""
    sorts = {p.sort for p in answer.effects}
    if verdict not in ("named", "fault", "sensor") or not sorts or "unnamed" in sorts:
        return None
    if sorts == {"physics"} and answer.verdict != "unnamed":
        return verdict == "named"
    return verdict in ("fault", "sensor") if "physics" not in sorts else None


def _inside(planted: Sequence[Planted], effects: Sequence[Form]) -> tuple[int, int]:
    """Number of intervals that contain the truth, and of all, of correctly named effects."""
    hits = count = 0
    for p in planted:
        for effect in effects:
            if not is_named(p, effect):
                continue
            for name, value in p.parameters.get(effect["effect"], {}).items():
                if (interval := interval_of(effect, name)) is not None:
                    count += 1
                    hits += interval[0] <= value <= interval[1]
    return hits, count


def interval_of(effect: Form, name: str, degree: bool = True) -> tuple[float, float, str] | None:
    """Return the ends of the 95 % interval of a parameter, and its unit.

    With `degree`, a parameter without an interval has that of the fault in its first period.
    """
    found = effect["parameters"].get(name)
    if found is not None and found.get("lower") is not None and found.get("upper") is not None:
        return float(found["lower"]), float(found["upper"]), str(found["unit"])
    periods = effect.get("periods") or ()
    if degree and periods and periods[0].get("u") is not None:
        middle, reach = float(periods[0]["degree"]), COVERAGE_OF_DEGREES * float(periods[0]["u"])
        return middle - reach, middle + reach, str(periods[0].get("unit", "1"))
    return None


def _reference(case: Case, form: Form) -> Reference:
    """The true model on the samples that the tool held out; empty if it has no solution."""
    spans = tuple((float(a), float(b)) for a, b in form["split"]["heldout"])
    relations = {f["signal"]: f["relation"] for f in form["fits"] if f["relation"]}
    try:
        return case.reference(Request(spans, relations))
    except (ValueError, ArithmeticError, np.linalg.LinAlgError):
        return Reference({})


def _ratio(form: Form, known: Reference, verdict: str) -> float | None:
    """Held-out error of the first signal over that of the true model; None without a repair."""
    fit = form.get("fit")
    if not fit or verdict not in ("named", "ambiguous", "fault", "sensor"):
        return None
    error = known.errors.get(fit["signal"], NAN)
    # The true model contains faults and sensor errors, so the whole explanation is compared.
    held = fit["heldout"]
    repaired = held["repaired"] if held.get("explained") is None else held["explained"]
    if repaired is None or not error > 0:
        return None
    return float(repaired) / error


def _course(known: Reference, form: Form, folder: Path) -> float:
    """Correlation of the reconstructed course with the truth; 0 if there is no course."""
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
