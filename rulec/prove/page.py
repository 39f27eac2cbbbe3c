"""The page of a run: goals, scores by strength, worst cases, how it was measured."""

from __future__ import annotations

from collections.abc import Sequence

from rulec_runtime.report.document import Head, document, facts, numbered, section
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.text import counted, number, safe

from rulec.prove import tables
from rulec.prove.pictures import draw_curve
from rulec.prove.results import Judged, Run
from rulec.prove.scores import Row, by, by_concealment, by_difficulty, plain, table

STYLE = """<style>
.word { white-space: nowrap; }
.panel .count { fill: var(--soft); font-weight: 400; }
#curve .mark.all .odd { display: initial; }
</style>"""


REMARK = (
    '<p class="key after">“not surely”: the 95 % interval holds values on both sides of the goal. '
    "Intervals of shares by Wilson, of ratio and course by drawing cases anew; intervals of "
    "parameters of one case are counted one by one.</p>"
)


def page(run: Run, made: Made | None = None) -> str:
    """Write the page; the same run gives the same text."""
    judged, rows = run.judged, table(run.judged)
    good = all(row.met for row in rows)
    parts = [
        ("By strength", "".join(numbered([curve])) if (curve := draw_curve(judged)) else ""),
        ("The worst cases", tables.worst_table(judged)),
        ("Names by their probability", tables.probabilities(judged)),
        ("By concealment", tables.groups(by_concealment(judged), "concealed by")),
        ("By difficulty", tables.groups(by_difficulty(judged), "made harder by")),
        ("By plant", tables.groups(by(judged, "plant"), "plant")),
        ("By half", tables.groups(by(judged, "half"), "half")),
        ("How this was measured", f'<div class="facts">{_measured(run)}</div>'),
    ]
    first = STYLE + tables.goals(rows, table(plain(run.judged))) + REMARK
    sections = [first, *(section(*part) for part in parts if part[1])]
    head = Head(
        kind="Proof on concealed effects",
        verdict=headline(run, rows),
        meaning=partition_words(run),
        badge=f'<span class="badge is-{"ok" if good else "F"}">{"✓" if good else "✗"}</span>',
        made=made,
    )
    return document(head, "".join(sections))


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


def _measured(run: Run) -> str:
    judged = run.judged
    failed = sum(bool(j.error) for j in judged)
    seconds = sum(j.seconds for j in judged)
    each = f"; {number(seconds / len(judged), 2)} s a case" if judged else ""
    clean = sum(j.clean for j in judged)
    return facts(
        [
            ("Partition", [f"{run.partition}: {partition_words(run)}"]),
            ("Cases", [f"{len(judged)}, {clean} of them clean; {failed} without an answer"]),
            ("Seeds", [f"{name}: {text}" for name, text in run.seeds.items()]),
            ("Openings of the final cases", [str(run.openings)]),
            ("Hash of the sealed answers", [run.digest] if run.digest else []),
            ("Version of the tool", [run.version] if run.version else []),
            ("Time", [f"{number(run.seconds, 3)} s by the clock{each}"]),
            ("Remarks", list(run.notes)),
        ]
    ) + _hashes(judged)


def _hashes(judged: Sequence[Judged]) -> str:
    """The hashes of all answers, folded because they are many."""
    hashes = ", ".join(f"{j.case} {j.digest[:12]}" for j in judged if j.digest)
    title = "Hash of each sealed answer (first 12 digits)"
    return f"<details><summary>{title}</summary><p>{safe(hashes)}</p></details>" if hashes else ""
