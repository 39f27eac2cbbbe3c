"""Tables of the page: goals, groups, worst cases."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import JustifyMethod
from rich.table import Table
from rich.text import Text
from rulec_runtime.output.terminal import one_line
from rulec_runtime.report.tables import Cell, columns, table
from rulec_runtime.report.text import fixed, listed, number, percent, safe

from rulec.prove.limits import PLAIN_GAIN, PLAIN_MARGIN, WORST_CASES
from rulec.prove.results import Judged
from rulec.prove.scores import Group, Reliability, Row, reliability


def grid(
    titles: Sequence[str],
    rows: Iterable[Sequence[str | Text]],
    wrap: bool = True,
    collapse: bool = False,
) -> Table:
    """Return a table for the terminal; titles of numeric columns begin with a dot."""
    shown = Table(box=None, pad_edge=False, collapse_padding=collapse)
    for title in titles:
        justify: JustifyMethod = "right" if title.startswith(".") else "left"
        shown.add_column(title.removeprefix("."), justify=justify, no_wrap=not wrap)
    for row in rows:
        shown.add_row(*(one_line(cell) if isinstance(cell, str) else cell for cell in row))
    return shown


def answer_of(judged: Judged) -> str:
    """Return the answer in one word."""
    if judged.error:
        return "failed"
    if judged.said:
        return judged.said[0].partition("@")[0]
    return "unnamed" if judged.verdict == "unnamed" else "nothing"


def right_of(judged: Judged) -> float:
    """Return the score of the name; of an effect without an entry, that of `unnamed`."""
    scores = (judged.name_right, judged.unnamed_right)
    return float(next((s for s in scores if s is not None), 0.0))


@dataclass(frozen=True)
class Bad:
    """A case that went wrong, and why."""

    judged: Judged
    why: str


def worst(judged: Sequence[Judged], count: int = WORST_CASES) -> list[Bad]:
    """Return certain mistakes first, then false claims on clean cases, no answer, missed effects.

    Within each kind the strongest effect comes first.
    """
    ranked = [(rank, j, why) for j in judged for rank, why in [_sort(j)] if why]
    ranked.sort(key=lambda r: (r[0], -np.nan_to_num(r[1].gain), r[1].case))
    return [Bad(j, why) for _, j, why in ranked[:count]]


def _sort(judged: Judged) -> tuple[int, str]:
    """Rank of the kind of mistake, and its reason; an empty text if nothing is wrong."""
    certain = judged.said and judged.verdict in ("named", "fault", "sensor")
    if judged.error:
        return 2, f"no answer: {judged.error}"
    if not judged.clean and certain and right_of(judged) == 0:
        wrong = judged.told_right is False
        return 0, "wrong and certain" + (", of another sort" if wrong else "")
    if judged.clean:
        return 1, "" if judged.clean_right in (None, 1) else "false claim on a clean recording"
    if right_of(judged) == 0:
        return 3, "missed"
    if judged.place_right == 0:
        return 4, "named at a wrong place"
    return 5, "named only in part" if right_of(judged) < 1 else ""


PARTS = ("place", "name", "clean", "unnamed", "told", "inside", "false")
"""Columns of a table of groups, after title and number of cases."""

PLAIN = f"strength of {PLAIN_GAIN:g} and margin of {PLAIN_MARGIN:g} at least"


def goals(rows: Sequence[Row], plainly: Sequence[Row]) -> str:
    """Write every score, its goal and whether it is met; `plainly` are the rows of plain cases."""
    of = columns(
        *("score", ".reached", ".goal", "", ".95 % interval", ".cases", ".right", ".plain to see")
    )
    body = [_goal(row, one) for row, one in zip(rows, plainly, strict=True)]
    note = f'<p class="soft">Plain to see: {safe(PLAIN)}.</p>'
    return table("scores and their goals", of, body) + note


def of_count(row: Row) -> str:
    """Return a score and its number of cases; a dash without cases."""
    return f"{value_of(row)} of {row.count}" if row.count else "–"


def _goal(row: Row, plain: Row) -> list[str | Cell]:
    symbol, style = {True: ("✓", "agrees"), False: ("✗", "contradicts"), None: ("–", "soft")}[
        row.met
    ]
    hits = "" if row.hits is None or not row.count else number(row.hits, 5)
    words = Cell(f"{symbol} {row.words}", f"{style} word")
    first = [safe(row.score), value_of(row), row.goal.text]
    return [*first, words, interval_of(row), str(row.count), hits, of_count(plain)]


def value_of(row: Row) -> str:
    """Return a score as text; a dash without cases."""
    if not math.isfinite(row.share):
        return "–"
    return f"{fixed(100 * row.share, 1)} %" if row.is_share else fixed(row.share, 3)


def interval_of(row: Row) -> str:
    """Return the 95 % interval as text; empty if there is none."""
    if not (math.isfinite(row.low) and math.isfinite(row.high)):
        return ""
    if row.is_share:
        return f"{fixed(100 * row.low, 1)} to {fixed(100 * row.high, 1)} %"
    return f"{fixed(row.low, 3)} to {fixed(row.high, 3)}"


def groups(found: Sequence[Group], title: str) -> str:
    """Write the shares of each group, each with its number of cases."""
    if not found:
        return ""
    rows = ([safe(g.title), str(g.count), *map(_part, g.shares)] for g in found)
    return table(title, columns(title, ".cases", *(f".{name}" for name in PARTS)), rows)


def _part(row: Row) -> str | Cell:
    if not row.count:
        return Cell("–", "soft")
    return f'{percent(row.share)} <span class="soft">of {row.count}</span>'


def probabilities(judged: Sequence[Judged]) -> str:
    """Write how many names are right, by their reported probability."""
    if not (found := reliability(judged)):
        return ""
    of = columns("told with", ".names", ".said, mean", ".right", ".95 % interval", "")
    return table("names by their probability", of, map(told_cells, found))


def told_cells(told: Reliability) -> tuple[str, ...]:
    """Return a bin of probabilities: ends, names, mean, share of right names and its interval."""
    shares = (told.low, told.high, told.said, told.share, *told.ends)
    low, high, said, right, least, most = (percent(share) for share in shares)
    return f"{low} to {high}", str(told.count), said, right, f"{least} to {most}", told.words


def worst_table(judged: Sequence[Judged]) -> str:
    """Write the worst cases: what was planted, what was reported, why it is wrong."""
    if not (found := worst(judged)):
        return "<p>No case went wrong.</p>"
    of = columns("case", "planted", "said", "wrong because", ".strength")
    rows = (
        (f"{safe(bad.judged.case)}{_where(bad.judged)}", *map(safe, bad_cells(bad)))
        for bad in found
    )
    return table("the worst cases", of, rows)


def _where(judged: Judged) -> str:
    words = listed(judged.concealed)
    return f'<br/><span class="soft">{safe(words)}</span>' if judged.concealed else ""


def bad_cells(bad: Bad) -> tuple[str, ...]:
    """Return what was planted, what was reported, why it is wrong, and the strength."""
    j = bad.judged
    return planted_words(j), said_words(j), bad.why, "" if j.clean else number(j.gain, 3)


def planted_words(judged: Judged) -> str:
    """Return the planted effects with their places."""
    places = f" at {listed(judged.places[:2])}" if judged.places else ""
    return f"{listed(judged.planted)}{places}" if judged.planted else "nothing"


def said_words(judged: Judged) -> str:
    """Return the reported names, or the answer without one."""
    return listed(judged.said) if judged.said and not judged.error else answer_of(judged)
