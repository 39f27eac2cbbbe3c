"""Scores of first contacts: is the report on a plant from its data sheet believable?

Five figures: reported parameters near the truth, ticks without an error, sound plants reported
sound, laws of another form named, and names that are certain and wrong.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report.text import number

from rulec.engines.call import Engine
from rulec.prove.campaign import OnProgress, folder_of, opened, spread
from rulec.prove.limits import BELIEVED, CERTAIN, GOAL_FOUND, GOAL_SOUND, GOAL_WRONG
from rulec.prove.partition import Partition, Planned
from rulec.prove.scores import Goal, Row, at_least, of_hits
from rulec.prove.tables import interval_of
from rulec.prove.terminal import MARK
from rulec.prove.truth.contacts import Contact, ContactAnswer

TICK = "none"
WITHOUT_VALUES = ("unsure", "unnamed", "failed")
"""Verdicts that themselves declare the values not believable."""

FIGURES = "believed", "ticks", "sound", "others", "wrong"
"""Names of the five figures in JSON."""

Form = Mapping[str, Any]


@dataclass(frozen=True)
class Judged:
    """A first contact and the scores of the answer.

    Attributes
    ----------
    other : the law of another form; empty on a sound plant
    said : findings with the probability of their class
    far : largest distance of a reported parameter from the truth, in u of the data sheet
    beyond : largest error of an output with a tick, noise subtracted, over what class and accuracy
        explain; None without a tick
    found : the sound plant is reported sound, or the other law is named in a certain class
    wrong : findings that are certain and of which no member is right
    """

    case: str
    other: str
    verdict: str
    said: tuple[tuple[str, float], ...]
    far: float
    beyond: float | None
    found: bool
    wrong: tuple[str, ...]
    seconds: float
    error: str = ""


def judge(answer: ContactAnswer, form: Form) -> Judged:
    """Score the tool's answer in JSON; a failed analysis reports nothing."""
    verdict, effects = str(form.get("verdict", "failed")), list(form.get("effects", ()))
    sure = [e for e in effects if _probability(e) >= CERTAIN and e.get("sort") != "free"]
    right = [_in_class(answer.names, e) for e in sure]
    found = verdict == TICK if not answer.other else any(right)
    if answer.other and not answer.names:
        at = {f"{e['module']}.{e['place']}" for e in (*form.get("locations", ()), *effects)}
        found = verdict == "unnamed" and bool(at & set(answer.places))
    return Judged(
        answer.case,
        answer.other,
        verdict,
        tuple((str(e["id"]), _probability(e)) for e in effects),
        0.0 if verdict in WITHOUT_VALUES else _far(answer, form),
        _beyond(answer, form) if verdict == TICK else None,
        found,
        tuple(str(e["id"]) for e, good in zip(sure, right, strict=True) if not good),
        float(form.get("seconds", 0.0)),
        str(form.get("error", "")),
    )


def _probability(effect: Form) -> float:
    return float(effect.get("class_probability") or effect["probability"] or 0.0)


def _in_class(names: Sequence[str], effect: Form) -> bool:
    """Whether the finding, or one that coincides with it, is right; there is one module."""
    same = {str(a["effect"]) for a in effect["alternatives"] if a.get("same")}
    return bool({str(effect["effect"]), *same} & set(names))


def _far(answer: ContactAnswer, form: Form) -> float:
    # A parameter that is not strained is near the data sheet, as the truth is.
    strain = (s for s in form["strain"] if s["parameter"] in answer.values)
    return max(
        (abs(s["value"] - answer.values[s["parameter"]]) / s["u"] for s in strain), default=0
    )


def _beyond(answer: ContactAnswer, form: Form) -> float:
    def over(fit: Form) -> float:
        off = max(fit["heldout"]["recalibrated"] ** 2 - fit["heldout"]["noise"] ** 2, 0.0)
        return float(off**0.5 / answer.allowed[fit["signal"]])

    return max((over(fit) for fit in form["fits"]), default=0.0)


def judged(
    partition: Partition, work: Path, seals: Sequence[str], engine: Engine, on_progress: OnProgress
) -> list[Judged]:
    """Open the answers and score them. Raises Changed if an answer is not what was sealed."""
    cases = partition.cases()
    todo = [(case, folder_of(work, i), seals[i]) for i, case in enumerate(cases)]
    found = spread(_opened, todo, engine, lambda n: on_progress("judging", n, len(todo)))
    return sorted(found, key=lambda j: j.case)


def _opened(case: Planned, folder: Path, seal: str) -> Judged:
    made, form = opened(case, folder, seal)
    assert isinstance(made, Contact)
    return judge(made.answer, form)


def figures(found: Sequence[Judged]) -> list[Row]:
    """Return the five figures with their goals."""
    ticks = [j.beyond for j in found if j.beyond is not None]
    sound, others = ([j.found for j in found if bool(j.other) == other] for other in (False, True))
    near, wrong = sum(j.far <= BELIEVED for j in found), sum(bool(j.wrong) for j in found)
    goal = Goal(0.0, GOAL_WRONG, f"{100 * GOAL_WRONG:.0f} %")
    return [
        of_hits(f"parameters within {BELIEVED:g} u of truth", at_least(1.0), len(found), near),
        of_hits(
            "ticks with an error within accuracy",
            at_least(1.0),
            len(ticks),
            sum(b <= 1 for b in ticks),
        ),
        of_hits("sound called sound", at_least(GOAL_SOUND), len(sound), sum(sound)),
        of_hits("other law named", at_least(GOAL_FOUND), len(others), sum(others)),
        of_hits(f"wrong at {CERTAIN:g}", goal, len(found), wrong),
    ]


def why(judged: Judged) -> str:
    """Return the mistakes of an answer as text; empty without any."""
    mistakes = [f"parameter {judged.far:.1f} u off the truth"] if judged.far > BELIEVED else []
    if judged.beyond is not None and judged.beyond > 1.0:
        mistakes.append(f"tick at {judged.beyond:.1f} times the accuracy")
    if judged.wrong:
        mistakes.append(f"wrong at {CERTAIN:g}: {', '.join(judged.wrong)}")
    if not judged.found:
        mistakes.append(f"not {'named' if judged.other else 'called sound'}")
    return "; ".join([*mistakes, judged.error] if judged.error else mistakes)


def show(out: Console, found: Sequence[Judged]) -> None:
    """Print the figures, and the cases with mistakes."""
    shown = Table(box=None, pad_edge=False)
    for title in ("score", "goal", "reached", "95 % interval", ""):
        shown.add_column(title, no_wrap=True)
    for row in figures(found):
        reached = f"{row.hits:g} of {row.count}"
        cells = (row.score, row.goal.text, reached, interval_of(row))
        shown.add_row(*cells, styled(MARK[row.met], row.verdict))
    out.print(shown)
    bad = Table("case", "verdict", "said", "because", box=None, pad_edge=False)
    for j in (j for j in found if why(j)):
        said = ", ".join(f"{name} {number(p, 2)}" for name, p in j.said)
        bad.add_row(*(one_line(w) for w in (j.case, j.verdict, said, why(j))))
    if bad.row_count:
        out.print(styled("\n[bold]Not as it should be[/]"))
        out.print(bad)


def form_of(found: Sequence[Judged]) -> dict[str, Any]:
    """Return the figures and all cases in the machine form."""
    rows = {
        name: {"value": r.share if r.count else None, "count": r.hits, "of": r.count}
        for name, r in zip(FIGURES, figures(found), strict=True)
    }
    return {"figures": rows, "cases": [dataclasses.asdict(j) for j in found]}
