"""Tables of the page: goals, confusion matrix, groups, baselines, worst cases."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from rulec_runtime.report.tables import Cell, Column, columns, framed, table
from rulec_runtime.report.text import fixed, listed, number, percent, safe

from rulec.prove.limits import PLAIN_GAIN, PLAIN_MARGIN
from rulec.prove.mistakes import (
    OTHERS,
    Bad,
    Confusion,
    answer_of,
    worst,
)
from rulec.prove.results import Judged
from rulec.prove.scores import Group, Reliability, Row, reliability

PARTS = ("place", "name", "clean", "unnamed", "told", "inside", "false", "at best")
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


def heat(found: Confusion) -> str:
    """Write the confusion matrix: planted in rows, reported in columns, tinted by row share."""
    head = '<th scope="col">planted</th><th>right</th>' + "".join(
        f'<th scope="col" class="turned"><span>{safe(name)}</span></th>' for name in found.columns
    )
    body = ""
    for name, rate, counts, right in zip(
        found.rows, found.rates, found.counts, found.right, strict=True
    ):
        cells = (
            _tinted(int(c), c / counts.sum(), r > 0, column)
            for c, r, column in zip(counts, right, found.columns, strict=True)
        )
        body += (
            f'<tr><th scope="row">{safe(name)}</th><td class="rate">{percent(rate)}</td>'
            f"{''.join(cells)}</tr>"
        )
    return framed(
        "what was said of what was planted",
        f'<table class="matrix heat"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>',
    )


def _tinted(count: int, share: float, right: bool, column: str) -> str:
    if not count:
        return "<td></td>"
    style = "right" if right else "other" if column in OTHERS else "wrong"
    return f'<td class="{style}" style="--tint:{round(20 + 80 * share)}%">{count}</td>'


def groups(found: Sequence[Group], title: str) -> str:
    """Write the shares of each group, each with its number of cases."""
    if not found:
        return ""
    rows = ([safe(g.title), str(g.count), *map(_part, g.shares), best_of(g)] for g in found)
    return table(title, columns(title, ".cases", *(f".{name}" for name in PARTS)), rows)


def best_of(group: Group) -> str:
    """Return the best possible shares of places and names; empty without effects."""
    return " / ".join(percent(share) for share in group.best) if group.best else ""


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


def baselines(judged: Sequence[Judged]) -> str:
    """Write held-out errors over that of recalibration: of the repair, and of the baselines."""
    parts = []
    for title, cases in (
        ("Something is missing", [j for j in judged if not j.clean]),
        ("Nothing is missing", [j for j in judged if j.clean]),
    ):
        rows = list(_rows_of(cases))
        if rows:
            of = [*columns("model", ".cases", ".middle", ".middle half"), Column("", "wide")]
            parts.append(f'<h3 class="after">{title}</h3>{table(title, of, rows)}')
    return "".join(parts)


def _rows_of(judged: Sequence[Judged]) -> Iterator[tuple[str, ...]]:
    ratios = {"repaired": _over(judged, "repaired")}
    for name in sorted({n for j in judged for n in j.baselines}):
        known = [j.baselines.get(name) for j in judged]
        ratios[name] = [v for v in known if v is not None and math.isfinite(v)]
    ratios["noise alone"] = _over(judged, "noise")
    shares = (0.25, 0.5, 0.75)
    quartiles = {n: np.quantile(values, shares).tolist() for n, values in ratios.items() if values}
    largest = max((middle for _, middle, _ in quartiles.values()), default=0.0)
    for name, (low, middle, high) in quartiles.items():
        width = 100 * middle / largest if largest > 0 else 0.0
        yield (
            safe(name),
            str(len(ratios[name])),
            fixed(middle, 2),
            f"{fixed(low, 2)} to {fixed(high, 2)}",
            f'<i class="meter" style="width:{width:.1f}%"></i>',
        )


def _over(judged: Sequence[Judged], name: str) -> list[float]:
    """Errors over that of recalibration, of the cases that have both."""
    pairs = ((getattr(j.errors, name), j.errors.recalibrated) for j in judged if j.errors)
    known = ((a, b) for a, b in pairs if a is not None and b is not None)
    return [a / b for a, b in known if math.isfinite(a) and math.isfinite(b) and b > 0]


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
