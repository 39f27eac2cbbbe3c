"""The page of a run: goals, scores by strength, confusion, worst cases, how it was measured."""

from __future__ import annotations

from collections.abc import Sequence

from rulec_runtime.report.document import Head, document, facts, numbered, section
from rulec_runtime.report.made import Made
from rulec_runtime.report.text import counted, number, safe

from rulec.prove import tables
from rulec.prove.attainable import at_best_words
from rulec.prove.mistakes import confusion
from rulec.prove.pictures import draw_curve, draw_ratio
from rulec.prove.results import Judged, Run
from rulec.prove.scores import Row, by, by_concealment, by_difficulty, plain, table

STYLE = """<style>
.word { white-space: nowrap; }
h3.after { margin: 1.4rem 0 .3rem; }
@media (max-width: 40rem) { .heat tbody th { white-space: normal; max-width: 6.5rem; } }
.panel .count { fill: var(--soft); font-weight: 400; }
.band.solid { fill-opacity: .85; }
#curve .mark.all .odd { display: initial; }
.heat thead th { vertical-align: bottom; }
.heat td { text-align: center; min-width: 1.9rem; }
.heat td.right { --of: var(--c0); } .heat td.wrong { --of: var(--c1); }
.heat td.other { --of: var(--c5); } .heat .rate { color: var(--soft); text-align: right; }
.heat td[style] { background: color-mix(in srgb, var(--of) calc(var(--tint) * .42), transparent); }
.heat td.right { font-weight: 700; }
.heat .turned { height: 9.5rem; vertical-align: bottom; padding: .2rem 0; }
.heat .turned span { writing-mode: vertical-rl; transform: rotate(180deg); white-space: nowrap; }
</style>"""


def page(run: Run, made: Made | None = None) -> str:
    """Write the page; the same run gives the same text."""
    judged, rows = run.shown, table(run.shown)
    good = all(row.met for row in rows)
    parts = [
        ("The worst cases", tables.worst_table(judged)),
        ("Names by their probability", tables.probabilities(judged)),
        ("By concealment", tables.groups(by_concealment(judged), "concealed by")),
        ("By difficulty", tables.groups(by_difficulty(judged), "made harder by")),
        ("By plant", tables.groups(by(judged, "plant"), "plant")),
        ("By half", tables.groups(by(judged, "half"), "half")),
        ("By partition", tables.groups(by(run.judged, "partition"), "partition")),
        ("How this was measured", f'<div class="facts">{_measured(run)}</div>'),
    ]
    first = STYLE + tables.goals(rows, table(plain(run.shown))) + _remark(run)
    sections = [first, *_pictures(judged), *(section(*part) for part in parts if part[1])]
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
    return f"{words}, on {counted(len(run.shown), f'{run.partition} case')}"


def partition_words(run: Run) -> str:
    """Return in a sentence what the partition proves."""
    if not run.shown:
        return "No case was judged."
    if run.partition == "final":
        return f"The final cases were opened {counted(run.openings, 'time')}, this one included."
    return "The tool was improved on these very cases: they prove nothing yet."


def _remark(run: Run) -> str:
    best = at_best_words(run.shown)
    first = f"{safe(best[:1].upper() + best[1:])}. " if best else ""
    return (
        f'<p class="key after">{first}“not surely”: the 95 % interval holds values on both sides '
        "of the goal. Intervals of shares by Wilson, of ratio and course by drawing cases anew; "
        "intervals of parameters of one case are counted one by one.</p>"
    )


def _pictures(judged: Sequence[Judged]) -> list[str]:
    """Curve, matrix, ratios and baselines, each only if it has cases."""
    curve, ratio = draw_curve(judged), draw_ratio(judged)
    found = confusion(judged)
    key = (
        "cases with one effect; rows: what was planted, best named first; columns: what was said "
        "(first name); blue: right, orange: wrong name, grey: no name; tint: share of the row"
    )
    matrix = f'<p class="key">{key}</p>{tables.heat(found)}' if found.rows else ""
    other = tables.baselines(judged)
    if other:
        other = (
            '<p class="key">held-out error over that of recalibration, below 1 is better; trees '
            "and PySINDy learn the residual: they name no place, no cause, no parameter</p>"
        ) + other
    numbers = list(numbered([f for f in (curve, ratio) if f is not None]))
    drawn = {"curve": numbers[0] if curve else "", "ratio": numbers[-1] if ratio else ""}
    parts = (
        ("By strength", drawn["curve"]),
        ("What is taken for what", matrix),
        ("How well the repaired model predicts", drawn["ratio"]),
        ("Beside learning alone", other),
    )
    return [section(title, body) for title, body in parts if body]


def _measured(run: Run) -> str:
    judged = run.shown
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
            ("PySINDy ran away", [f"in {counted(run.ran_away, 'case')}"]),
            ("Remarks", list(run.notes)),
        ]
    ) + _hashes(judged)


def _hashes(judged: Sequence[Judged]) -> str:
    """The hashes of all answers, folded because they are many."""
    hashes = ", ".join(f"{j.case} {j.digest[:12]}" for j in judged if j.digest)
    title = "Hash of each sealed answer (first 12 digits)"
    return f"<details><summary>{title}</summary><p>{safe(hashes)}</p></details>" if hashes else ""
