"""How a second recording changed an answer, and whether that is what the recipe foretold."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from rulec.prove.further_inputs import RECIPE
from rulec.prove.judge import is_named, judged_words
from rulec.prove.limits import LEAST_REPORTED
from rulec.prove.results import COVERED, RUN, Further, Judged
from rulec.prove.truth.sealed import Answer, Planted

Form = Mapping[str, Any]

EXPERIMENT = "rulec experiment"

NAMELESS, PERIODS = "~", "!/"
"""Mark of a term without a name in the name of a set's part, and marks of how a fault came."""


def further_of(
    answer: Answer, first: Judged, recipe: Form, before: Form, after: Mapping[str, Form]
) -> Further:
    """Judge a second round; `after` are answers with a second recording by the way it was made."""
    known = _titles(before, *after.values())
    foretold = recipe.get("explanations", before.get("standing", ()))
    stood = [right_set(answer, one["names"], known) for one in foretold]
    sure_before = sure_of(answer, before, known)
    told = Further(
        case=answer.case,
        outcome=_outcome(recipe, after),
        why=_said(str(recipe.get("error", ""))),
        sure_before=sure_before,
        stood=any(stood),
    )
    if not after:
        return told
    judged = {arm: _judged(answer, first, form) for arm, form in after.items()}
    sure = {
        arm: sure_before if "not_run" in form else sure_of(answer, form, known)
        for arm, form in after.items()
    }
    steps = recipe["steps"]
    expected, realised = _nats(stood, recipe, after[RECIPE])
    return replace(
        told,
        why=str(after[RECIPE].get("not_run", "")),
        steps=len(steps),
        minutes=float(steps[-1]["until"]) / 60.0,
        expected=_foretold(recipe),
        sure=sure,
        nats_expected=expected,
        nats=realised,
        after=judged,
    )


def _covers(recipe: Form) -> bool:
    """Does a recipe cover what may be set, and tell nothing apart?"""
    return all(step["covers"] for step in recipe["steps"])


def _foretold(recipe: Form) -> tuple[float, ...]:
    """How sure the truth is before and after, by the recipe; nothing where it only covers."""
    if _covers(recipe):
        return ()
    return float(recipe["certainty"][0]), float(recipe["certainty"][-1])


def _said(error: str) -> str:
    """What the tool said, without what the proof writes around it."""
    said = error.rpartition(f"{EXPERIMENT}: ")[2].rpartition(" (")
    return said[0].removeprefix("rulec: ") or error


def _outcome(recipe: Form, after: Mapping[str, Form]) -> str:
    if after:
        return "stalled" if "not_run" in after[RECIPE] else COVERED if _covers(recipe) else RUN
    return "refused" if "error" in recipe else "alike"


def _judged(answer: Answer, first: Judged, form: Form) -> Judged:
    """The first answer stays where the plant could not be run so."""
    return first if "not_run" in form else judged_words(answer, form, first.partition)


def sure_of(answer: Answer, form: Form, known: Mapping[str, str]) -> float:
    """Probability of the true explanation in an answer; 0 where it is not told."""
    sets = form.get("standing", ())
    right = (s["probability"] for s in sets if right_set(answer, s["names"], known))
    return float(sum(right))


def right_set(answer: Answer, names: Sequence[str], known: Mapping[str, str]) -> bool:
    """Does a set hold what is planted, and nothing else?

    What has no name must be nameless in the set, at a right place; what nobody recorded drives
    several places at once, so any number of them will do.
    """
    if answer.verdict == "unnamed":
        places = {place for p in answer.effects for place in p.places}
        return bool(names) and all(NAMELESS in name and _place(name) in places for name in names)
    planted = [p for p in answer.effects if p.names]
    if len(names) != len(planted):
        return False
    found = [[_is(p, name, known) for name in names] for p in planted]
    return all(map(any, found)) and all(map(any, zip(*found, strict=True)))


def _is(planted: Planted, name: str, known: Mapping[str, str]) -> bool:
    id_ = name.rstrip(PERIODS)
    if NAMELESS in name:
        return False
    module, _, rest = id_.partition(".")
    entry, _, place = rest.partition("@")
    effect = known.get(id_, entry)
    said = {"effect": effect, "id": id_, "modules": (module,), "place": place}
    return is_named(planted, said)


def _place(name: str) -> str:
    """Where a term without a name is, such as `B.P_el` of `signal:B.P_el~B.l`."""
    return name.partition(":")[2].partition(NAMELESS)[0]


def _titles(*forms: Form) -> dict[str, str]:
    """Entries of the catalogue by the ids that answers tell."""
    found: dict[str, str] = {}
    for form in forms:
        for effect in form.get("effects", ()):
            for one in (effect, *effect["alternatives"]):
                found[str(one["id"])] = str(one["effect"])
    return found


def _nats(stood: Sequence[bool], recipe: Form, after: Form) -> tuple[float | None, float | None]:
    """Log Bayes factor of the likeliest true explanation against the likeliest other, expected and
    realised; None where the truth did not stand, or is not told any more."""
    sets = recipe["explanations"]
    true = next((i for i, right in enumerate(stood) if right), None)
    other = next((i for i, right in enumerate(stood) if not right), None)
    if true is None or other is None or _covers(recipe) or "not_run" in after:
        return None, None
    now = {frozenset(s["names"]): s["probability"] for s in after.get("standing", ())}
    odds = [now.get(frozenset(sets[i]["names"]), 0.0) for i in (true, other)]
    was = math.log(sets[true]["probability"] / sets[other]["probability"])
    expected = float(recipe["factors"][true][other])
    floor = [max(p, LEAST_REPORTED) for p in odds]
    return expected, math.log(floor[0] / floor[1]) - was if any(odds) else None
