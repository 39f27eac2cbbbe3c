"""Scores of rigs in the terminal, as JSON and as a page."""

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.console import Console
from rulec_runtime.output.terminal import styled
from rulec_runtime.report import parts as of_page
from rulec_runtime.report.chart import Figure, figures_html
from rulec_runtime.report.document import Head, document
from rulec_runtime.report.parts import Part, Table, Words
from rulec_runtime.report.text import counted, number, percent

from rulec.mismatch.answer.pictures import ReadingCourses, over_time
from rulec.mismatch.result import Curves
from rulec.prove.real.rig_folder import FalseAlarm
from rulec.prove.real.run_tool import MODELS
from rulec.prove.real.score import Alarm, Scored, Total, alarms, totals

SCORES = (".place", ".name", ".class", ".p", ".size", ".false", ".sure", ".utility")
ERRORS = ("rig", "reading", *(f".{model}" for model in MODELS), ".noise", ".grey box")

NOTE = (
    "name: share of what is missing whose id is the headline of a finding; class: whose id is in "
    "the set that a finding leaves open; p: probability told for that set; size: intervals that "
    "hold the truth; utility: of the ambiguity set, as the DX competition 2026 scores it. Errors: "
    "root mean square on rows that were never shown; a plant that was not written predicts as the "
    "one before it."
)


@dataclass(frozen=True)
class Result:
    """A run over rigs; `renamed` has by rig the differences under other names, None if not run."""

    scored: tuple[Scored, ...]
    manifest: tuple[FalseAlarm, ...]
    renamed: Mapping[str, Sequence[str]] | None
    digest: str

    @property
    def totals(self) -> list[Total]:
        return totals(self.scored)

    @property
    def alarms(self) -> list[Alarm]:
        return alarms(self.manifest, self.scored)

    @property
    def headline(self) -> str:
        """The result in one line."""
        judged = [s for s in self.scored if s.headline is not None]
        right = sum(s.named == 1.0 for s in judged)
        sure = sum(bool(s.sure) for s in self.scored)
        asked = counted(len(self.scored), "rig")
        named = f"{right} of {len(judged)} with a known effect are named in its class"
        return f"{asked}: {named}, {sure} wrong and sure"


def tell(out: Console, result: Result) -> None:
    """Print the tables."""
    out.print(styled("[bold]{}[/]", result.headline))
    out.print(styled("[dim]{}[/]\n", NOTE))
    of_page.tell(out, parts(result))


def page(result: Result, made: str = "") -> str:
    """Write the same as one HTML file, with the origin of the rigs and pictures."""
    rigs = [
        (r.name, r.title, r.licence, r.source, r.truth.source if r.truth else "nothing is known")
        for r in (s.rig for s in result.scored)
    ]
    of = ("rig", "what", "licence", "source", "how the answer is known")
    figures = [figure for s in result.scored if (figure := draw(s)) is not None]
    body = [
        Part("", [Words(NOTE, soft=True)]),
        *parts(result),
        Part("Rigs", [Table(of, rigs)]),
        Part("", [figures_html(figures)]),
    ]
    return document(Head(kind="Real recordings", verdict=result.headline, made=made), body)


def form(result: Result) -> dict[str, Any]:
    """Return the machine form; what is not a number is null."""
    totals = {}
    for total in result.totals:
        fields = dataclasses.asdict(total).items()
        totals[total.title] = {
            k: None if isinstance(v, float) and math.isnan(v) else v for k, v in fields
        }
    return {
        "sealed": result.digest,
        "totals": totals,
        "rigs": {s.rig.name: _rig_form(s, result.renamed) for s in result.scored},
        "false_alarms": [
            {**vars(alarm.stated), "told_again": alarm.again} for alarm in result.alarms
        ],
    }


def _rig_form(s: Scored, renamed: Mapping[str, Sequence[str]] | None) -> dict[str, Any]:
    fields = (
        *("verdict", "place", "headline", "named", "probability", "inside", "silent"),
        *("utility", "predicted", "noise", "signal", "grey_box", "refused", "error"),
    )
    found = {name: getattr(s, name) for name in fields}
    found["predicted"] = {
        name: {key: value for key, value in errors.items() if key != "course"}
        for name, errors in s.predicted.items()
    }
    found |= {"title": s.rig.title, "sealed": s.rig.seal}
    for name in ("said", "false", "sure"):
        found[name] = [
            {"causes": [vars(cause) for cause in f.causes], "probability": f.probability}
            for f in getattr(s, name)
        ]
    return found | ({"hidden": renamed[s.rig.name]} if renamed and s.rig.name in renamed else {})


def parts(result: Result) -> Iterator[Part]:
    """Yield the tables."""
    answers = []
    for s in result.scored:
        words = "; ".join(found.text for found in s.said)
        answers.append((s.rig.name, s.error or (f"{s.verdict}: {words}" if words else s.verdict)))
    yield Part("Answers", [Table(("rig", "told"), answers)])
    yield Part("Scores", [Table(("rig", *SCORES), [_answer_row(s) for s in result.scored])])
    errors = [row for s in result.scored for row in _error_rows(s)]
    yield Part("Errors on unseen rows", [Table(ERRORS, errors)])
    means = []
    for t in result.totals:
        ends = "–" if math.isnan(t.low) else f"{number(t.low, 2)} to {number(t.high, 2)}"
        means.append((t.title, number(t.value, 2), ends, str(t.count)))
    yield Part("All rigs", [Table(("", ".mean", ".95 % interval", ".rigs"), means)])
    if result.alarms:
        of_alarms = ("rig", "wrong", ".told again", "story", "right")
        rows = []
        for alarm in result.alarms:
            one, again = alarm.stated, "no" if alarm.again is None else percent(alarm.again)
            rows.append((one.rig, f"{one.wrong} at {one.place}", again, one.story, one.right))
        yield Part("False alarms", [Table(of_alarms, rows)])
    if result.renamed is not None:
        same = [(name, "; ".join(diff) or "the same") for name, diff in result.renamed.items()]
        yield Part("Under other names", [Table(("rig", ""), same)])


def _answer_row(s: Scored) -> list[str]:
    inside = f"{s.inside[0]}/{s.inside[1]}" if s.inside[1] else "–"
    shares = (s.place, s.headline, s.named, s.probability)
    scores = ["–" if v is None else percent(v) for v in shares]
    if s.silent is not None:
        scores = ["–", "silent" if s.silent else "no", "–", "–"]
    false = [str(len(found)) if s.rig.truth else "–" for found in (s.false, s.sure)]
    utility = "–" if s.utility is None else f"{s.utility:.2f}"
    return [s.rig.name, *scores, inside, *false, utility]


def _error_rows(s: Scored) -> Iterator[list[str]]:
    """One row per reading, first the one that counts."""

    def text(value: float | None) -> str:
        return "–" if value is None else number(value, 3)

    for name in sorted(s.predicted, key=lambda n: n != s.signal):
        errors = s.predicted[name]
        cells = [text(errors[model]) for model in MODELS]
        cells[-1] += " *" if s.refused or s.error else ""
        cells += [text(s.noise.get(name)), text(s.grey_box if name == s.signal else None)]
        yield [s.rig.name, f"{name} [{errors['unit']}]", *cells]


def draw(scored: Scored) -> Figure | None:
    """Draw the reading that counts on unseen rows, and each plant's prediction; None without."""
    found = scored.predicted.get(scored.signal, {})
    if not found.get("course"):
        return None
    order = np.argsort(found["course"]["time"], kind="stable")
    course = {name: np.array(values)[order] for name, values in found["course"].items()}
    course["repaired"] = course.pop("adopted")
    every = np.ones(len(order), dtype=bool)
    curves = Curves(**course, inside=every, heldout=~every, drivers={})
    reading = ReadingCourses(
        signal=scored.signal, unit=found["unit"], curves=curves, located=~every
    )
    errors = ", ".join(f"{number(found[model], 3)} {model}" for model in MODELS)
    return dataclasses.replace(
        over_time(reading, None),
        name=f"rig-{scored.rig.name}",
        title=f"{scored.rig.name}: {scored.rig.title}",
        caption=f"Root mean square error in {found['unit']} on unseen rows: {errors}.",
    )
