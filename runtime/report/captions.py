"""One sentence below each picture: what it shows, in words and numbers computed from the data."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from runtime.findings import Finding
from runtime.report.series import Curves, largest_run, persistent, sides_of
from runtime.report.text import counted, listed, moment, number, percent
from runtime.report.truth import Cases

NAMED = 4
"""Names in one sentence."""


def period(since: float, until: float) -> str:
    """A period in words."""
    return f"from {moment(since)} s to {moment(until)} s"


def say_estimates(curves: Curves) -> str:
    """Which two estimates of the module disagree most, by how much and when."""
    module = curves.sides[0].module
    names = listed([side.short for side in curves.sides])
    if not curves.judged.any():
        return f"No sample was judged; the estimates of {module} are drawn where they exist."
    compared = [sides_of(r) for r in curves.residuals]
    own = [
        (i, runs)
        for i, runs in persistent(curves)
        if len(compared[i]) == 2 and set(compared[i]) <= set(curves.sides)
    ]
    if not own:
        judged = counted(int(curves.judged.sum()), "judged sample")
        return f"The estimates of {module} ({names}) agree within their limits in {judged}."
    i, runs = max(own, key=lambda pair: excess(curves, *pair))
    first, last = largest_run(curves.values[i], runs)
    mean = float(np.mean(curves.values[i, first : last + 1]))
    limit = float(np.mean(curves.limits[i, first : last + 1]))
    one, other = (side.short for side in compared[i])
    side = "above" if mean > 0 else "below"
    when = period(curves.time[first], curves.time[last])
    again = f"; it leaves its limit in {counted(len(runs), 'period')}" if len(runs) > 1 else ""
    return (
        f"The {one} estimate of {module} stands {number(abs(mean))} l/h {side} the {other} "
        f"estimate {when}, where {number(limit, 2)} l/h is the limit{again}."
    )


def excess(curves: Curves, row: int, runs: Sequence[tuple[int, int]]) -> float:
    """Size of a residual over its limit, mean over the run where it is largest."""
    first, last = largest_run(curves.values[row], runs)
    ratio = np.abs(curves.values[row]) / curves.limits[row]
    return float(np.mean(ratio[first : last + 1]))


def say_residuals(curves: Curves) -> str:
    """Which residuals leave their limits, and how far."""
    total = len(curves.residuals)
    if not curves.judged.any():
        return "No sample was judged, so no residual counts as fired."
    found = sorted(
        ((excess(curves, i, runs), curves.residuals[i].id) for i, runs in persistent(curves)),
        reverse=True,
    )
    if not found:
        return f"None of the {total} residuals leaves its limit for three samples in a row."
    names = [f"{name} ({number(times, 2)} times its limit)" for times, name in found[:NAMED]]
    if len(found) > NAMED:
        names.append(counted(len(found) - NAMED, "other"))
    rest = total - len(found)
    stay = f"; the other {rest} stay{'s' * (rest == 1)} inside" if rest else ""
    return f"{listed(names)} leave{'s' * (len(found) == 1)} the shaded zero band{stay}."


def say_degrees(findings: Sequence[Finding], worst: Sequence[Finding]) -> str:
    """How large each diagnosed fault becomes, and when."""
    if not worst:
        return "No fault was diagnosed, so the degree stays at zero."
    parts = []
    for finding in worst:
        times = sum(f.fault.id == finding.fault.id for f in findings)
        often = f", the largest of {times} findings" if times > 1 else ""
        parts.append(
            f"{finding.fault.id} reaches {number(finding.degree)} (95 %: {number(finding.lower)} "
            f"to {number(finding.upper)}) {period(finding.since, finding.until)}{often}"
        )
    return "; ".join(parts) + "."


def say_cases(cases: Cases) -> str:
    """How often the right fault was named, and how far its degree is off."""
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
                f", there its degree is off by {number(off.mean(), 2)} on average and "
                f"{number(off.max(), 2)} at most, and the bounds hold the truth in "
                f"{percent(float(covered[hit].mean()))}"
            )
    if healthy.any():
        alarms = int((healthy & ~right).sum())
        said = "nothing is reported" if not alarms else f"{alarms} are false alarms"
        parts.append(f"of {counted(int(healthy.sum()), 'sample')} without a fault {said}")
    text = "; ".join(parts)
    return text[:1].upper() + text[1:] + "."


def say_shares(cases: Cases, table: np.ndarray) -> str:
    """How many cases lie close to the truth."""
    middle = len(table) // 2
    near, next_to = table[middle].sum(), table[middle - 1 : middle + 2].sum()
    off = float(np.abs(cases.discrepancy).mean())
    return (
        f"{percent(float(near))} of {counted(len(cases), 'case')} lie within 0.05 of the true "
        f"degree and {percent(float(next_to))} within 0.15; the mean absolute discrepancy is "
        f"{number(off, 2)}."
    )
