"""The page of a run: goals, scores by strength, worst cases, how it was measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.report.chart import Axis, Panel
from rulec_runtime.report.document import Head, document, facts, numbered, section
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.text import counted, number, percent, safe

from rulec.prove import scores, tables
from rulec.prove.limits import ENOUGH_CASES, MOSTLY
from rulec.prove.results import Judged, Run
from rulec.prove.scores import HALVES, Bin, Row, by, curve, plain, table

ROOM = 1.14
"""Top of the scale of shares: the space above 1 shows the counts."""


@dataclass(frozen=True)
class Decades(Axis):
    """A logarithmic scale, labelled with the numbers themselves."""

    def labels(self) -> list[str]:
        return [number(10.0**tick, 15) for tick in self.ticks]


@dataclass(frozen=True)
class Percents(Axis):
    """A scale of shares, labelled in percent."""

    def labels(self) -> list[str]:
        return [percent(tick) for tick in self.ticks]


def draw_curve(judged: Sequence[Judged]) -> Figure | None:
    """Draw right names and places against strength, a panel per half; None without cases."""
    names, places = curve(judged, "name_right"), curve(judged, "place_right")
    halves = [half for half in HALVES if names[half] or places[half]]
    every = [b for half in halves for b in (*names[half], *places[half])]
    if not every:
        return None
    ends = [np.log10([min(b.low for b in every), max(b.high for b in every)])]
    ticks = tuple(float(t) for t in range(int(np.floor(ends[0][0])), int(ends[0][1]) + 1))
    across = Decades(float(ends[0][0]), float(ends[0][1]), ticks)
    parts = []
    for half in halves:
        last = half == halves[-1]
        svg = _panel(across, half, names[half], places[half], last)
        parts.append(plot(svg, last, "strength: gain in log likelihood of the true model"))
    key = "blue: right name, with 95 % interval; orange: right place; numbers: cases"
    return Figure(
        name="curve",
        title="What is named of how strong an effect",
        key=key,
        body="".join(parts),
        caption=_say(names),
    )


def _panel(across: Axis, half: str, names: list[Bin], places: list[Bin], foot: bool) -> str:
    panel = Panel(across, Percents(0.0, ROOM, (0.0, 0.25, 0.5, 0.75, 1.0)), 190)
    drawn, fixed_ = [], []
    for bins, style, symbol in ((places, "s1", "square"), (names, "s0", "disc")):
        x = np.array([np.log10(b.centre) for b in bins])
        y = np.array([b.share for b in bins])
        if symbol == "disc":
            low, high = np.array([b.ends for b in bins]).reshape(-1, 2).T
            drawn.append(panel.band(x, low, high, style))
        drawn.append(panel.curve(x, y, style))
        fixed_.append(panel.marks(x, y, symbol, f"{style} all"))
    fixed_ += [
        panel.text(float(np.log10(b.centre)), ROOM, str(b.count), "value count", 12) for b in names
    ]
    return panel.drawn(f"{half}: share of right answers by strength", half, drawn, fixed_, foot)


def _say(names: dict[str, list[Bin]]) -> str:
    """The strength above which nine of ten are named, per half."""
    sentences = []
    for half, bins in names.items():
        if not bins:
            continue
        above = [bins[i:] for i in range(len(bins))]
        above = [part for part in above if sum(b.count for b in part) >= ENOUGH_CASES] or [bins]
        shares = [sum(b.hits for b in part) / sum(b.count for b in part) for part in above]
        good = [b.low for b, share in zip(bins, shares, strict=False) if share >= MOSTLY]
        sentences.append(
            f"{half}: of effects with a gain above {number(good[0], 2)}, nine of ten are named "
            "rightly"
            if good
            else f"{half}: {percent(shares[0])} are named rightly, and nine of ten at no strength"
        )
    return f"{'; '.join(sentences)}.".capitalize() if sentences else "No effect was to be named."


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
        ("By strength", "".join(numbered([figure])) if (figure := draw_curve(judged)) else ""),
        ("The worst cases", tables.worst_table(judged)),
        ("Names by their probability", tables.probabilities(judged)),
        ("By concealment", tables.groups(scores.by_concealment(judged), "concealed by")),
        ("By difficulty", tables.groups(scores.by_difficulty(judged), "made harder by")),
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
