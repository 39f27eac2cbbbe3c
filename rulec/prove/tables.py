"""Tables of the page: goals, groups, worst cases."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rulec_runtime.report.tables import Cell, columns, table
from rulec_runtime.report.text import fixed, listed, number, percent, safe

from rulec.prove.limits import PLAIN_GAIN, PLAIN_MARGIN
from rulec.prove.results import Judged
from rulec.prove.scores import Group, Reliability, Row, reliability
from rulec.prove.worst_cases import Bad, answer_of, worst

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
    return table("the worst cases", of, map(_bad, found))


def _bad(bad: Bad) -> tuple[str, ...]:
    j = bad.judged
    where = f'<br/><span class="soft">{safe(listed(j.concealed))}</span>' if j.concealed else ""
    strength = "" if j.clean else number(j.gain, 3)
    said = (planted_words(j), said_words(j), bad.why, strength)
    return f"{safe(j.case)}{where}", *map(safe, said)


def planted_words(judged: Judged) -> str:
    """Return the planted effects with their places."""
    places = f" at {listed(judged.places[:2])}" if judged.places else ""
    return f"{listed(judged.planted)}{places}" if judged.planted else "nothing"


def said_words(judged: Judged) -> str:
    """Return the reported names, or the answer without one."""
    return listed(judged.said) if judged.said and not judged.error else answer_of(judged)
