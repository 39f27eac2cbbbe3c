"""Tables of the terminal and of the page, and those of a run: goals, difficulties, worst cases."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console, JustifyMethod
from rich.table import Table as Grid
from rich.text import Text
from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.report import tables as of_pages
from rulec_runtime.report.document import section
from rulec_runtime.report.text import fixed, listed, number, safe

from rulec.prove.limits import WORST_CASES
from rulec.prove.results import Judged
from rulec.prove.scores import Row, reliability, table, trust

MARKS = {"✓": ("green", "agrees"), "✗": ("red", "contradicts"), "–": ("dim", "soft")}
"""Styles of cells in the terminal and on a page, by their first character."""

SYMBOLS = {True: "✓", False: "✗", None: "–"}


@dataclass(frozen=True)
class Table:
    """A table with its title and a remark; headings of numeric columns begin with a dot."""

    title: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""


def tell(out: Console, tables: Iterable[Table]) -> None:
    """Print tables; columns of words may be wrapped."""
    for one in tables:
        if one.title:
            out.print(styled("\n[bold]{}[/]", one.title))
        grid = Grid(box=None, pad_edge=False, collapse_padding=True)
        for heading in one.headings:
            numeric = heading.startswith(".")
            justify: JustifyMethod = "right" if numeric else "left"
            grid.add_column(heading.removeprefix("."), justify=justify, no_wrap=numeric)
        for row in one.rows:
            grid.add_row(*(Text(one_line(cell), _styles(cell)[0]) for cell in row))
        out.print(grid)
        if one.note:
            out.print(styled("[dim]{}[/]", one.note))


def sections(tables: Iterable[Table], untitled: str = "") -> str:
    """Write tables as sections of a page; one without a title gets `untitled`."""
    found = []
    for one in tables:
        rows = ([of_pages.Cell(safe(c), _styles(c)[1]) for c in row] for row in one.rows)
        title = one.title or untitled
        body = of_pages.table(title, of_pages.columns(*one.headings), rows)
        note = f'<p class="soft">{safe(one.note)}</p>' if one.note else ""
        found.append(section(safe(title), body + note))
    return "".join(found)


def _styles(cell: str) -> tuple[str, str]:
    return MARKS.get(cell[:1], ("", ""))


REMARK = (
    "“not surely”: the 95 % interval, by Wilson, holds values on both sides of the goal. Intervals "
    "of parameters of one case are counted one by one."
)


def tables(judged: Sequence[Judged]) -> Iterator[Table]:
    """Yield the tables of a run; those without a row are left out."""
    goals = [
        (row.score, row.goal.text, str(row.count), value_of(row), interval_of(row), verdict_of(row))
        for row in table(judged)
    ]
    of_goals = ("score", ".goal", ".cases", ".reached", ".95 % interval", "")
    yield Table("", of_goals, goals, REMARK)
    if bins := reliability(judged):
        rows = [
            (b.score, str(b.count), b.goal.text, value_of(b), interval_of(b), trust(b))
            for b in bins
        ]
        titles = ("told with", ".names", ".said, mean", ".right", ".95 % interval", "")
        yield Table("Names by their probability", titles, rows)
    if found := worst(judged):
        of_cases = ("case", "planted", "said", "because", ".strength")
        cases = [
            (
                *(bad.case, planted_words(bad), said_words(bad), why),
                number(bad.gain, 3) if bad.gain > 0.0 else "",
            )
            for bad, why in found
        ]
        yield Table("The worst cases", of_cases, cases)


def verdict_of(row: Row) -> str:
    """Return the verdict of a score with its symbol."""
    return f"{SYMBOLS[row.met]} {row.words}"


def value_of(row: Row) -> str:
    """Return a score as text; a dash without cases."""
    return f"{fixed(100 * row.share, 1)} %" if row.count else "–"


def interval_of(row: Row) -> str:
    """Return the 95 % interval as text; empty if there is none."""
    return f"{fixed(100 * row.low, 1)} to {fixed(100 * row.high, 1)} %" if row.count else ""


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


def planted_words(judged: Judged) -> str:
    """Return the planted effects with their places."""
    places = f" at {listed(judged.places[:2])}" if judged.places else ""
    return f"{listed(judged.planted)}{places}" if judged.planted else "nothing"


def said_words(judged: Judged) -> str:
    """Return the reported names, or the answer without one."""
    if judged.error:
        return "failed"
    if judged.said:
        return listed(judged.said)
    return "unnamed" if judged.verdict == "unnamed" else "nothing"
