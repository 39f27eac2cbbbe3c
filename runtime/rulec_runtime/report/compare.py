"""Draw the diagnosis against the truth: Figure 10 of the seed paper."""

import numpy as np

from rulec_runtime.report.chart import Figure, Panel, axis
from rulec_runtime.report.text import counted, number, percent
from rulec_runtime.report.truth import Cases


def draw_cases(cases: Cases) -> Figure:
    """Diagnosed against true degree; a perfect diagnosis lies on the diagonal."""
    top = max(float(cases.true.max()), float(cases.upper.max()), 0.1)
    across, down = (axis(0.0, top, title=f"{of} degree [1]") for of in ("true", "diagnosed"))
    panel = Panel("diagnosed against true degree", across, down, 340)
    ends = np.array([0.0, down.high])
    panel.curve(ends, ends, "truth")
    for named, symbol, style in ((True, "disc", "s0"), (False, "cross", "fired")):
        index = np.flatnonzero(cases.named == named)
        index = index[panel.apart(cases.true[index], cases.degree[index])]
        true = cases.true[index]
        if named:
            panel.bars(true, cases.lower[index], cases.upper[index], style)
        panel.marks(true, cases.degree[index], symbol, style)
    key = ["● rightly named, with 95 % bounds", "× another fault, none or a false alarm"]
    return Figure(
        name="cases",
        title="Diagnosed against true degree",
        key=[*key, "dashed: truth"],
        panels=[panel],
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
