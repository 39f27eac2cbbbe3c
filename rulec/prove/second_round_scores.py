"""How a second recording changed an answer, and whether the recipe predicted that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from rulec.prove.judge import is_named, judged_words
from rulec.prove.results import COVERED, RUN, Further, Judged
from rulec.prove.second_round_inputs import RECIPE
from rulec.prove.truth.sealed import Answer, Planted

Form = Mapping[str, Any]

NAMELESS, PERIODS = "~", "!/"
"""Mark of a nameless term in a candidate set, and marks of how a fault began."""


def further_of(
    answer: Answer, first: Judged, recipe: Form, before: Form, after: Mapping[str, Form]
) -> Further:
    """Judge a second round; `after` has the answers with a second recording by arm."""
    known = _entries(before, *after.values())
    candidates = recipe.get("explanations", before.get("standing", ()))
    right = [right_set(answer, one["names"], known) for one in candidates]
    sure_before = sure_of(answer, before, known)
    judged = Further(
        case=answer.case,
        outcome="refused" if "error" in recipe else "alike",
        why=_message(str(recipe.get("error", ""))),
        sure_before=sure_before,
        stood=any(right),
    )
    if not after:
        return judged
    # If the plant could not be run so, the first answer stays.
    sure, again = {}, {}
    for arm, form in after.items():
        stalled = "not_run" in form
        sure[arm] = sure_before if stalled else sure_of(answer, form, known)
        again[arm] = first if stalled else judged_words(answer, form, first.partition)
    steps, covers = recipe["steps"], _covers(recipe)
    return replace(
        judged,
        outcome="stalled" if "not_run" in after[RECIPE] else COVERED if covers else RUN,
        why=str(after[RECIPE].get("not_run", "")),
        steps=len(steps),
        minutes=float(steps[-1]["until"]) / 60.0,
        expected=() if covers else tuple(float(recipe["certainty"][end]) for end in (0, -1)),
        sure=sure,
        after=again,
    )


def _covers(recipe: Form) -> bool:
    """Whether a recipe only covers the allowed range and distinguishes nothing."""
    return all(step["covers"] for step in recipe["steps"])


def _message(error: str) -> str:
    """The tool's message without the text that the proof adds around it."""
    said = error.rpartition("rulec experiment: ")[2].rpartition(" (")
    return said[0].removeprefix("rulec: ") or error


def sure_of(answer: Answer, form: Form, known: Mapping[str, str]) -> float:
    """Return the probability of the true explanation in an answer; 0 if it is not reported."""
    sets = form.get("standing", ())
    right = (s["probability"] for s in sets if right_set(answer, s["names"], known))
    return float(sum(right))


def right_set(answer: Answer, names: Sequence[str], known: Mapping[str, str]) -> bool:
    """Return whether a candidate set contains what is planted, and nothing else.

    An effect without a name must be nameless in the set, at a right place. An unrecorded driver
    acts at several places at once, so any number of them is right.
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
    if NAMELESS in name:
        return False
    id_ = name.rstrip(PERIODS)
    module, _, rest = id_.partition(".")
    entry, _, place = rest.partition("@")
    effect = known.get(id_, entry)
    return is_named(planted, {"effect": effect, "id": id_, "modules": (module,), "place": place})


def _place(name: str) -> str:
    """The place of a nameless term, such as `B.P_el` of `signal:B.P_el~B.l`."""
    return name.partition(":")[2].partition(NAMELESS)[0]


def _entries(*forms: Form) -> dict[str, str]:
    """Entries of the catalogue by the ids in answers."""
    found: dict[str, str] = {}
    for form in forms:
        for effect in form.get("effects", ()):
            for one in (effect, *effect["alternatives"]):
                found[str(one["id"])] = str(one["effect"])
    return found
