"""Scores of first contacts: is the report on a plant from its data sheet believable?

Three figures: sound plants reported sound, laws of another form named, and names that are certain
and wrong.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rulec_runtime.report.text import number

from rulec.prove.campaign import Campaign, opened
from rulec.prove.judge import class_probability
from rulec.prove.limits import CERTAIN
from rulec.prove.partition import Planned
from rulec.prove.scores import Row, goal_of, of_hits
from rulec.prove.tables import Table, interval_of, tell, verdict_of
from rulec.prove.truth.contacts import Contact, ContactAnswer

TICK = "none"
FIGURES = "sound", "others", "wrong"
"""Names of the figures in JSON."""

Form = Mapping[str, Any]


@dataclass(frozen=True)
class Judged:
    """A first contact and the scores of the answer.

    Attributes
    ----------
    other : the law of another form; empty on a sound plant
    said : findings with the probability of their class
    found : the sound plant is reported sound, or the other law is named in a certain class
    wrong : findings that are certain and of which no member is right
    """

    case: str
    other: str
    verdict: str
    said: tuple[tuple[str, float], ...]
    found: bool
    wrong: tuple[str, ...]
    seconds: float
    error: str = ""


def judge(answer: ContactAnswer, form: Form) -> Judged:
    """Score the tool's answer in JSON; a failed analysis reports nothing."""
    verdict, effects = str(form.get("verdict", "failed")), list(form.get("effects", ()))
    sure = [e for e in effects if class_probability(e) >= CERTAIN and e.get("sort") != "free"]
    right = [_in_class(answer.names, e) for e in sure]
    found = verdict == TICK if not answer.other else any(right)
    if answer.other and not answer.names:
        at = {f"{e['module']}.{e['place']}" for e in (*form.get("locations", ()), *effects)}
        found = verdict == "unnamed" and bool(at & set(answer.places))
    return Judged(
        answer.case,
        answer.other,
        verdict,
        tuple((str(e["id"]), class_probability(e)) for e in effects),
        found,
        tuple(str(e["id"]) for e, good in zip(sure, right, strict=True) if not good),
        float(form.get("seconds", 0.0)),
        str(form.get("error", "")),
    )


def _in_class(names: Sequence[str], effect: Form) -> bool:
    """Whether the finding, or one that coincides with it, is right; there is one module."""
    same = {str(a["effect"]) for a in effect["alternatives"] if a.get("same")}
    return bool({str(effect["effect"]), *same} & set(names))


def judged(run: Campaign, seals: Sequence[str]) -> list[Judged]:
    """Open the answers and score them. Raises Changed if an answer is not what was sealed."""
    return sorted(run.workers.each("judging", _opened, run.kept(seals)), key=lambda j: j.case)


def _opened(case: Planned, folder: Path, seal: str) -> Judged:
    made, form = opened(case, folder, seal)
    assert isinstance(made, Contact)
    return judge(made.answer, form)


def figures(found: Sequence[Judged]) -> list[Row]:
    """Return the figures with their goals."""
    sound, others = ([j.found for j in found if bool(j.other) == other] for other in (False, True))
    wrong = sum(bool(j.wrong) for j in found)
    return [
        of_hits("sound called sound", goal_of("sound"), len(sound), sum(sound)),
        of_hits("other law named", goal_of("other"), len(others), sum(others)),
        of_hits(f"wrong at {CERTAIN:g}", goal_of("wrong"), len(found), wrong),
    ]


def why(judged: Judged) -> str:
    """Return the mistakes of an answer as text; empty without any."""
    mistakes = [f"wrong at {CERTAIN:g}: {', '.join(judged.wrong)}"] if judged.wrong else []
    if not judged.found:
        mistakes.append(f"not {'named' if judged.other else 'called sound'}")
    return "; ".join([*mistakes, judged.error] if judged.error else mistakes)


def show(out: Console, found: Sequence[Judged]) -> None:
    """Print the figures, and the cases with mistakes."""
    reached = [
        (r.score, r.goal.text, f"{r.hits:g} of {r.count}", interval_of(r), verdict_of(r))
        for r in figures(found)
    ]
    bad = [
        (j.case, j.verdict, ", ".join(f"{name} {number(p, 2)}" for name, p in j.said), mistakes)
        for j in found
        if (mistakes := why(j))
    ]
    tell(out, [Table("", ("score", ".goal", ".reached", ".95 % interval", ""), reached)])
    if bad:
        tell(out, [Table("Not as it should be", ("case", "verdict", "said", "because"), bad)])


def form_of(found: Sequence[Judged]) -> dict[str, Any]:
    """Return the figures and all cases in the machine form."""
    rows = {
        name: {"value": r.share if r.count else None, "count": r.hits, "of": r.count}
        for name, r in zip(FIGURES, figures(found), strict=True)
    }
    return {"figures": rows, "cases": [dataclasses.asdict(j) for j in found]}
