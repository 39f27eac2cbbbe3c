"""How a second recording changed an answer, and whether the recipe predicted that; tables of its
benefit, beside that of baselines of equal length.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from statistics import fmean
from typing import Any

from rulec_runtime.report.parts import Part, Table, Words
from rulec_runtime.report.text import counted, percent

from rulec.prove.judge import is_named, judge
from rulec.prove.results import ARMS, COVERED, RECIPE, RUN, Further, Judged
from rulec.prove.scores import by_probability, table
from rulec.prove.truth.sealed import Answer, Planted

Form = Mapping[str, Any]

NAMELESS, PERIODS = "~", "!/"
"""Mark of a nameless term in a candidate set, and marks of how a fault began."""


def further_of(
    answer: Answer, first: Judged, recipe: Form, before: Form, after: Mapping[str, Form]
) -> Further:
    """Judge a second round; `after` has the answers with a second recording by arm."""
    effects = {
        str(one["id"]): str(one["effect"])
        for form in (before, *after.values())
        for effect in form.get("effects", ())
        for one in (effect, *effect["alternatives"])
    }
    sure_before = sure_of(answer, before, effects)
    # The tool's message without the text that the proof adds around it.
    error = str(recipe.get("error", ""))
    message = error.rpartition("rulec experiment: ")[2].rpartition(" (")[0].removeprefix("rulec: ")
    judged = Further(
        case=answer.case,
        outcome="refused" if "error" in recipe else "alike",
        why=message or error,
        sure_before=sure_before,
    )
    if not after:
        return judged
    # If the plant could not be run so, the first answer stays.
    sure, again = {}, {}
    for arm, form in after.items():
        stalled = "not_run" in form
        sure[arm] = sure_before if stalled else sure_of(answer, form, effects)
        again[arm] = first if stalled else judge(answer, form)
    covers = all(step["covers"] for step in recipe["steps"])
    return replace(
        judged,
        outcome="stalled" if "not_run" in after[RECIPE] else COVERED if covers else RUN,
        why=str(after[RECIPE].get("not_run", "")),
        expected=() if covers else tuple(float(recipe["certainty"][end]) for end in (0, -1)),
        sure=sure,
        after=again,
    )


def sure_of(answer: Answer, form: Form, effects: Mapping[str, str]) -> float:
    """Return the probability of the true explanation in an answer; 0 if it is not reported."""
    sets = form.get("standing", ())
    return float(sum(s["probability"] for s in sets if right_set(answer, s["names"], effects)))


def right_set(answer: Answer, names: Sequence[str], effects: Mapping[str, str]) -> bool:
    """Return whether a candidate set contains what is planted, and nothing else.

    An effect without a name must be nameless in the set, at a right place. An unrecorded driver
    acts at several places at once, so any number of them is right.
    """
    if answer.verdict == "unnamed":
        # Such as `signal:B.P_el~B.l`, whose place is `B.P_el`.
        parts = [name.partition(":")[2].partition(NAMELESS) for name in names]
        places = {place for p in answer.effects for place in p.places}
        return bool(names) and all(mark and place in places for place, mark, _ in parts)

    def is_right(planted: Planted, name: str) -> bool:
        id_ = name.rstrip(PERIODS)
        module, _, rest = id_.partition(".")
        entry, _, place = rest.partition("@")
        found = {"effect": effects.get(id_, entry), "id": id_, "modules": (module,), "place": place}
        return NAMELESS not in name and is_named(planted, found)

    planted = [p for p in answer.effects if p.names]
    right = [[is_right(p, name) for name in names] for p in planted]
    each = all(map(any, right)) and all(map(any, zip(*right, strict=True)))
    return len(names) == len(planted) and each


FALSE_NAMES = 6
SCORES = {0: "place right", 1: "name right", 2: "clean", 3: "unnamed", FALSE_NAMES: "false names"}
"""Scores of a second recording, by their position in `scores.table`."""

OUTCOMES = {
    RUN: "run again as proposed",
    COVERED: "run again with steps that only cover what may be set: nothing is to be told apart",
    "alike": "there is nothing that may be set, the tool says; the first answer stays",
    "refused": "the tool plans nothing; the first answer stays",
    "stalled": "the plant cannot be run as proposed; the first answer stays",
}


def gained(further: Sequence[Further]) -> Iterator[tuple[str, ...]]:
    """Yield predicted against realised certainty by bins of the former: the bin, the number of
    recipes, and both means."""
    ran = [f for f in further if f.outcome == RUN]
    for low, high, own in by_probability(ran, lambda f: f.expected[1]):
        said, realised = (fmean(f.expected[1] for f in own), fmean(f.sure[RECIPE] for f in own))
        bin_ = f"{percent(low)} to {percent(high)}"
        yield bin_, str(len(own)), percent(said), percent(realised)


def tables_of_rounds(judged: Sequence[Judged], further: Sequence[Further]) -> Iterator[Part]:
    """Yield the outcomes, the scores before and after, and the predicted certainty."""
    outcomes = Counter(f.outcome for f in further)
    reasons = Counter(f.why for f in further if f.why)
    found = [(str(outcomes[name]), words) for name, words in OUTCOMES.items() if outcomes[name]]
    found += [(str(count), why) for why, count in reasons.items()]
    ran = [f for f in further if f.outcome in (RUN, COVERED)]
    if not ran:
        title = f"Round two: none of {counted(len(further), 'case')} was run again."
        yield Part(title, [Table((".", ""), found)])
        return
    before, after = fmean(f.sure_before for f in ran), fmean(f.sure[RECIPE] for f in ran)
    title = (
        f"Round two: {len(ran)} of {counted(len(further), 'case')} were run again. There the true "
        f"one was {percent(before)} sure on average, and is {percent(after)} sure now."
    )
    yield Part(title, [Table((".", ""), found)])
    arms = [arm for arm in ARMS if any(arm in f.after for f in further)]
    columns = [table(judged), *(table(after_of(judged, further, arm)) for arm in arms)]
    rows = []
    for place, score in SCORES.items():
        own = [column[place] for column in columns]
        if place == FALSE_NAMES:
            rows.append((score, *(f"{row.hits:g} of {row.count}" for row in own)))
        else:
            rows.append((f"{score} ({own[0].count})", *(row.text for row in own)))
    sure = [[f.sure_before for f in further]]
    sure += [[f.sure.get(arm, f.sure_before) for f in further] for arm in arms]
    rows.append(("sure of the truth", *(percent(fmean(own)) for own in sure)))
    headings = ("score", ".first", *(f".{arm}" for arm in arms))
    note = "; ".join(f"{arm}: {ARMS[arm]}" for arm in arms if any(arm in f.after for f in ran))
    yield Part("Of all cases", [Table(headings, rows), Words(note, soft=True)])
    title = "How sure of the true explanation: predicted and realised"
    titles = (".predicted", ".recipes", ".mean", ".realised")
    yield Part(title, [Table(titles, list(gained(further)))])


def after_of(judged: Sequence[Judged], further: Sequence[Further], arm: str) -> list[Judged]:
    """Return the answers with a second recording; the first answer if there is none."""
    changed: Mapping[str, Judged] = {f.case: f.after[arm] for f in further if arm in f.after}
    return [changed.get(j.case, j) for j in judged]
