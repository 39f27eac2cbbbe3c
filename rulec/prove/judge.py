"""Compares the tool's answer with the sealed one."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rulec.prove.limits import CERTAIN, COVERAGE_OF_DEGREES, MENTIONED
from rulec.prove.results import Claim, Judged
from rulec.prove.truth.sealed import Answer, Planted

Form = Mapping[str, Any]


def judge(answer: Answer, form: Form) -> Judged:
    """Score the reported effects."""
    effects, verdict = list(form.get("effects", ())), form.get("verdict", "failed")
    named, unnamed = [p for p in answer.effects if p.names], answer.verdict == "unnamed"
    place = place_right(answer.effects, form) if answer.effects else None
    # A free curve is no name.
    names = [e for e in effects if e.get("sort") != "free" and e["probability"] is not None]
    inside = [
        interval[0] <= value <= interval[1]
        for p in named
        for e in effects
        if is_named(p, e)
        for name, value in p.parameters.get(e["effect"], {}).items()
        if (interval := interval_of(e, name)) is not None
    ]
    return Judged(
        case=answer.case,
        verdict_true=answer.verdict,
        verdict=verdict,
        planted=tuple(f"{p.effect}@{p.module}" for p in answer.effects),
        places=tuple(dict.fromkeys(place for p in answer.effects for place in p.places)),
        said=tuple(f"{e['effect']}@{e['module']}.{e['place']}" for e in effects),
        gain=sum(p.gain for p in answer.effects),
        place_right=place,
        name_right=name_right(named, effects) if named and not unnamed else None,
        clean_right=None if answer.effects else float(verdict == "none"),
        unnamed_right=float(verdict == "unnamed" and (place or 0.0) > 0) if unnamed else None,
        told_right=_is_sort_right(answer, verdict),
        inside=(sum(inside), len(inside)),
        claims=tuple(
            Claim(float(e["probability"]), any(is_named(p, e) for p in named)) for e in names
        ),
        seconds=float(form.get("seconds", float("nan"))),
        error=str(form.get("error", "")),
    )


def _share_right(planted: Planted, effect: Form) -> float:
    """Share of the names that a finding leaves open, its own first, that are right: in the right
    module or at an equivalent place.

    It is 1/n of n candidates, and more if the key has several names for the effect in this plant.
    """
    candidates, right = [effect], 0
    if (effect["probability"] or 0.0) < CERTAIN:
        candidates += [a for a in effect["alternatives"] if a["probability"] >= MENTIONED]
    for one in candidates:
        modules = {one["id"].partition(".")[0]}
        modules |= set(effect["modules"]) if one["id"] == effect["id"] else set()
        at = {f"{m}.{effect['place']}" for m in modules}
        here = planted.module.partition(".")[0] in modules or bool(at & set(planted.places))
        right += one["effect"] in planted.names and here
    return right / len(candidates)


def is_named(planted: Planted, effect: Form) -> bool:
    """Return whether the name of a finding is right, whatever else it leaves open."""
    return _share_right(planted, {**effect, "alternatives": (), "probability": 1.0}) == 1.0


def _credit(planted: Planted, effects: Sequence[Form]) -> float:
    return max((_share_right(planted, e) for e in effects), default=0.0)


def name_right(planted: Sequence[Planted], effects: Sequence[Form]) -> float:
    """Return the share of effects named correctly; false names beyond their number lower it."""
    credit = sum(_credit(p, effects) for p in planted)
    return float(credit / max(len(planted), len(effects)))


def place_right(planted: Sequence[Planted], form: Form) -> float:
    """Return the share of effects with the right place.

    A correctly named effect has its place; one of several candidates counts as much as its name.
    """
    effects, locations = form.get("effects", ()), form.get("locations", ())
    latent = form.get("hidden_driver")
    parts = [*effects, *locations, *([latent] if latent else [])]
    reported = {f"{e['module']}.{e['place']}" for e in parts}
    reported |= {f"{m}.{e['place']}" for e in effects for m in e["modules"]}
    if not effects:
        # A term without a name that may be at several places is reported at the first of them.
        reported |= {place for e in locations for place in e.get("also", ())}
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


def interval_of(effect: Form, name: str, degree: bool = True) -> tuple[float, float, str] | None:
    """Return the ends of the 95 % interval of a parameter, and its unit.

    With `degree`, a parameter without an interval has that of the fault in its first period.
    """
    found = effect["parameters"].get(name)
    if found is not None and found.get("lower") is not None and found.get("upper") is not None:
        return float(found["lower"]), float(found["upper"]), str(found["unit"])
    periods = effect.get("periods") or ()
    if degree and periods and periods[0].get("u") is not None:
        middle, half = float(periods[0]["degree"]), COVERAGE_OF_DEGREES * float(periods[0]["u"])
        return middle - half, middle + half, str(periods[0].get("unit", "1"))
    return None
