"""Draw the diagnosis against the truth: Figures 10 and 11 of the seed paper."""

import numpy as np

from rulec_runtime.report.captions import say_cases, say_shares
from rulec_runtime.report.chart import Panel, axis
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.tables import framed
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
        caption=say_cases(cases),
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
        caption=say_shares(cases, table),
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
