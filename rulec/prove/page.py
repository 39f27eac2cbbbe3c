"""A run in the terminal and as a page: goals, worst cases, how it was measured."""

from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Console
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.document import Head, document
from rulec_runtime.report.parts import Facts, Part, Table, Words, tell
from rulec_runtime.report.text import Html, counted, listed, number

from rulec.prove.limits import WORST_CASES
from rulec.prove.results import Judged, Run
from rulec.prove.scores import Row, reliability, table, trust
from rulec.prove.second_round_table import tables_of_rounds

SYMBOLS = {True: "✓", False: "✗", None: "–"}

REMARK = (
    "“not surely”: the 95 % interval, by Wilson, holds values on both sides of the goal. Intervals "
    "of parameters of one case are counted one by one."
)


def show(out: Console, run: Run) -> None:
    """Print the scores and the worst cases."""
    out.print(styled("[bold]{}[/]", headline(run, table(run.judged))))
    out.print(styled("[dim]{}[/]\n", partition_words(run)))
    tell(out, tables(run))


def page(run: Run, made: str = "") -> str:
    """Write the page; the same run gives the same text."""
    rows, judged = table(run.judged), run.judged
    good = all(row.met for row in rows)
    each = f"; {number(sum(j.seconds for j in judged) / len(judged), 2)} s a case" if judged else ""
    clean, failed = sum(j.clean for j in judged), sum(bool(j.error) for j in judged)
    measured = Facts(
        [
            ("Partition", [f"{run.partition}: {partition_words(run)}"]),
            ("Cases", [f"{len(judged)}, {clean} of them clean; {failed} without an answer"]),
            ("Seed", [str(run.seed)]),
            ("Openings of the final cases", [str(run.openings)]),
            ("Hash of the sealed answers", [run.digest] if run.digest else []),
            ("Version of the tool", [run.version] if run.version else []),
            ("Time", [f"{number(run.seconds, 3)} s by the clock{each}"]),
            ("Remarks", list(run.notes)),
        ],
        "facts",
    )
    head = Head(
        kind="Proof on concealed effects",
        verdict=headline(run, rows),
        meaning=partition_words(run),
        badge=Html(f'<span class="badge is-{"ok" if good else "F"}">{SYMBOLS[good]}</span>'),
        made=made,
    )
    return document(head, [*tables(run), Part("How this was measured", [measured])])


def headline(run: Run, rows: Sequence[Row]) -> str:
    """Return in a sentence how many goals are met, on how many cases."""
    met, judged = (sum(r.met is value for r in rows) for value in (True, None))
    words = f"{met} of {len(rows)} scores reach their goal"
    if judged:
        words += f", {judged} without a case"
    return f"{words}, on {counted(len(run.judged), f'{run.partition} case')}"


def partition_words(run: Run) -> str:
    """Return in a sentence what the partition proves."""
    if not run.judged:
        return "No case was judged."
    if run.partition == "final":
        return f"The final cases were opened {counted(run.openings, 'time')}, this one included."
    return "The tool was improved on these very cases: they prove nothing yet."


def tables(run: Run) -> Iterator[Part]:
    """Yield the tables of a run: goals, then probabilities, worst cases and a second round, if
    there are any."""
    goals = [
        (r.score, r.goal.text, str(r.count), r.text, r.interval_text, f"{SYMBOLS[r.met]} {r.words}")
        for r in table(run.judged)
    ]
    scores = Table(("score", ".goal", ".cases", ".reached", ".95 % interval", ""), goals)
    yield Part("Scores and their goals", [scores, Words(REMARK, soft=True)])
    if bins := reliability(run.judged):
        rows = [
            (b.score, str(b.count), b.goal.text, b.text, b.interval_text, trust(b)) for b in bins
        ]
        titles = ("told with", ".names", ".said, mean", ".right", ".95 % interval", "")
        yield Part("Names by their probability", [Table(titles, rows)])
    if found := worst(run.judged):
        cases = [(j.case, *_words(j), why, number(j.gain, 3) * (j.gain > 0.0)) for j, why in found]
        of_cases = ("case", "planted", "said", "because", ".strength")
        yield Part("The worst cases", [Table(of_cases, cases)])
    if run.further:
        yield from tables_of_rounds(run.judged, run.further)


def worst(judged: Sequence[Judged], count: int = WORST_CASES) -> list[tuple[Judged, str]]:
    """Return cases that went wrong, and why: certain mistakes first, then false claims on clean
    cases, no answer, missed effects; within each kind the strongest effect first."""
    ranked = [(rank, j, why) for j in judged for rank, why in [_sort(j)] if why]
    ranked.sort(key=lambda r: (r[0], -np.nan_to_num(r[1].gain), r[1].case))
    return [(j, why) for _, j, why in ranked[:count]]


def _sort(judged: Judged) -> tuple[int, str]:
    """Rank of the kind of mistake, and its reason; an empty text if nothing is wrong."""
    certain = judged.said and judged.verdict in ("named", "fault", "sensor")
    scores = (judged.name_right, judged.unnamed_right)
    right = next((s for s in scores if s is not None), 0.0)
    if judged.error:
        return 2, f"no answer: {judged.error}"
    if not judged.clean and certain and right == 0:
        wrong = judged.told_right is False
        return 0, "wrong and certain" + (", of another sort" if wrong else "")
    if judged.clean:
        return 1, "" if judged.clean_right in (None, 1) else "false claim on a clean recording"
    if right == 0:
        return 3, "missed"
    if judged.place_right == 0:
        return 4, "named at a wrong place"
    return 5, "named only in part" if right < 1 else ""


def _words(judged: Judged) -> tuple[str, str]:
    """The planted effects with their places; the reported names, or the answer without one."""
    places = f" at {listed(judged.places[:2])}" if judged.places else ""
    planted = f"{listed(judged.planted)}{places}" if judged.planted else "nothing"
    unnamed = "unnamed" if judged.verdict == "unnamed" else "nothing"
    said = listed(judged.said) if judged.said else unnamed
    return planted, "failed" if judged.error else said
