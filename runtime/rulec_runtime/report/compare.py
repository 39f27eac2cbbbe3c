"""Draw the diagnosis against the truth: Figures 10 and 11 of the seed paper."""

import numpy as np

from rulec_runtime.report.chart import Panel, axis
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.tables import framed
from rulec_runtime.report.text import counted, number, percent
from rulec_runtime.report.truth import DEGREES, ROWS, Cases, shares

POINTS = 120
"""Cells of the scatter plot in each direction; one mark per cell."""


def draw_cases(cases: Cases) -> Figure:
    """Diagnosed against true degree; a perfect diagnosis lies on the diagonal."""
    top = max(float(cases.true.max()), float(cases.upper.max()), 0.1)
    scale = axis(0.0, top, 6)
    panel = Panel(scale, scale, 340)
    ends = np.array([0.0, scale.high])
    drawn = [panel.curve(ends, ends, "truth")]
    marks = []
    for named, symbol, style in ((True, "disc", "s0"), (False, "cross", "fired")):
        index = _one_a_cell(cases, cases.named == named, scale.high)
        true, degree = cases.true[index], cases.degree[index]
        if named:
            drawn.append(panel.bars(true, cases.lower[index], cases.upper[index], "s0"))
        marks.append(panel.marks(true, degree, symbol, style))
    svg = panel.drawn("diagnosed against true degree", "diagnosed degree [1]", drawn, marks, True)
    key = "● rightly named, with 95 % bounds; × another fault, none or a false alarm; dashed: truth"
    return Figure(
        name="cases",
        title="Diagnosed against true degree",
        key=key,
        body=plot(svg, True, "true degree [1]"),
        caption=_named_right(cases),
        narrow=True,
    )


def draw_shares(cases: Cases) -> Figure:
    """Table of shares: discrepancy by rows, true degree by columns."""
    table = shares(cases)
    head = "".join(f'<th scope="col">{d}</th>' for d in (*DEGREES, "total"))
    rows = [
        f'<tr><th scope="row">{_signed(centre)}</th>{"".join(map(_cell, row))}'
        f"{_cell(row.sum(), False)}</tr>"
        for centre, row in zip(ROWS, table, strict=True)
    ]
    foot = "".join(_cell(v, False) for v in (*table.sum(axis=0), table.sum()))
    body = framed(
        "shares of cases by discrepancy and true degree",
        '<table class="shares"><thead><tr><th>discrepancy</th>'
        f'<th colspan="{len(DEGREES) + 1}" scope="colgroup">true degree</th></tr>'
        f'<tr><th scope="col">diagnosed − true</th>{head}</tr></thead><tbody>{"".join(rows)}'
        f'<tr class="total"><th scope="row">total</th>{foot}</tr></tbody></table>',
    )
    key = "share of cases; bins centred as written, outer ones open; a fault not named counts as 0"
    return Figure(
        name="shares",
        title="Discrepancy",
        key=key,
        body=body,
        caption=_close(cases, table),
        narrow=True,
    )


def _signed(value: float) -> str:
    return "0" if value == 0 else f"{value:+.1f}".replace("-", "−")


def _cell(share: float, shaded: bool = True) -> str:
    """A share as a cell; larger shares are darker."""
    tint = f' style="--tint:{round(100 * min(share / 0.3, 1))}%"' if shaded and share > 0 else ""
    return f"<td{tint}>{f'{share:.2f}' if share > 0 else '·'}</td>"


def _one_a_cell(cases: Cases, chosen: np.ndarray, top: float) -> np.ndarray:
    """One of the chosen cases per cell of the plot; the others would lie on top of it."""
    index = np.flatnonzero(chosen)
    cells = np.stack([cases.true[index], cases.degree[index]]) * (POINTS / top)
    _, first = np.unique(np.floor(cells), axis=1, return_index=True)
    return index[np.sort(first)]


def _named_right(cases: Cases) -> str:
    """How often the right fault was named, and the error of its degree."""
    faulty, right = cases.fault >= 0, cases.named
    healthy = ~faulty
    parts = []
    if faulty.any():
        hit = faulty & right
        parts.append(
            f"The right fault is named in {hit.sum()} of {counted(int(faulty.sum()), 'sample')} "
            "with a fault"
        )
        if hit.any():
            off = np.abs(cases.discrepancy[hit])
            covered = (cases.lower <= cases.true) & (cases.true <= cases.upper)
            parts[-1] += (
                f"; there its degree is off by {number(off.mean(), 2)} on average and "
                f"{number(off.max(), 2)} at most, and the bounds hold the truth in "
                f"{percent(float(covered[hit].mean()))}"
            )
    if healthy.any():
        alarms = int((healthy & ~right).sum())
        reported = "nothing is reported" if not alarms else f"{alarms} are false alarms"
        parts.append(f"on {counted(int(healthy.sum()), 'sample')} without a fault {reported}")
    text = "; ".join(parts)
    return text[:1].upper() + text[1:] + "."


def _close(cases: Cases, table: np.ndarray) -> str:
    """Shares of the cases close to the truth."""
    middle = len(table) // 2
    near, next_to = table[middle].sum(), table[middle - 1 : middle + 2].sum()
    return (
        f"{percent(float(near))} of {counted(len(cases), 'case')} lie within 0.05 of the true "
        f"degree and {percent(float(next_to))} within 0.15; the mean absolute discrepancy is "
        f"{number(float(np.abs(cases.discrepancy).mean()), 2)}."
    )
