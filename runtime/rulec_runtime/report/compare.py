"""Draw the diagnosis against the truth: Figure 10 of the seed paper."""

import numpy as np

from rulec_runtime.report.chart import Panel, axis
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.text import counted, number, percent
from rulec_runtime.report.truth import Cases

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
        index = np.flatnonzero(cases.named == named)
        # One case per cell of the plot: the others would lie on top of it.
        cells = np.stack([cases.true[index], cases.degree[index]]) * (POINTS / scale.high)
        index = index[np.sort(np.unique(np.floor(cells), axis=1, return_index=True)[1])]
        true, degree = cases.true[index], cases.degree[index]
        if named:
            drawn.append(panel.bars(true, cases.lower[index], cases.upper[index], "s0"))
        marks.append(panel.marks(true, degree, symbol, style))
    svg = panel.drawn("diagnosed against true degree", "diagnosed degree [1]", drawn, marks, True)
    return Figure(
        name="cases",
        title="Diagnosed against true degree",
        key="● rightly named, with 95 % bounds; × another fault, none or a false alarm; "
        "dashed: truth",
        body=plot(svg, True, "true degree [1]"),
        caption=_named_right(cases),
        narrow=True,
    )


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
            off = np.abs(cases.degree - cases.true)[hit]
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
