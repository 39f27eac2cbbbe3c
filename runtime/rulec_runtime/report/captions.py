"""One sentence below each picture: what it shows, with numbers computed from the data."""

from collections.abc import Sequence

import numpy as np

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.report.series import Curves, persistent, sides_of
from rulec_runtime.report.text import bounds, counted, degree, listed, number, percent
from rulec_runtime.report.time_axis import period_in_words
from rulec_runtime.report.truth import Cases
from rulec_runtime.report.wording import worst_first

NAMED = 4
"""Names in one sentence."""


def say_estimates(curves: Curves) -> str:
    """Which two estimates of the module disagree most, by how much and when.

    The distance is that of the flows as drawn; the threshold applies to the deviation from the
    baseline.
    """
    module = curves.sides[0].module
    names = [
        side.short
        for side, flow in zip(curves.sides, curves.flows, strict=True)
        if np.isfinite(flow[curves.judged]).any()
    ]
    if not curves.judged.any():
        return f"No sample was judged; the estimates of {module} are drawn where they exist."
    if len(names) < 2:
        only = f"only the {names[0]} estimate of {module}" if names else f"no estimate of {module}"
        return f"Where samples were judged, {only} could be formed; there is nothing to compare."
    compared = [sides_of(r) for r in curves.residuals]
    own = [
        (i, runs)
        for i, runs in persistent(curves)
        if len(compared[i]) == 2 and set(compared[i]) <= set(curves.sides)
    ]
    if not own:
        judged = counted(int(curves.judged.sum()), "judged sample")
        agree = f"The estimates of {module} ({listed(names)})"
        return f"{agree} agree within their thresholds in {judged}."
    strongest = [(i, *curves.main_run(i, runs), len(runs)) for i, runs in own]
    i, first, last, times = max(strongest, key=lambda x: excess(curves, x[0], [x[1:3]]))
    one, other = compared[i]
    run = slice(first, last + 1)
    apart = float(np.mean(curves.apart(one, other)[run]))
    side = "above" if apart > 0 else "below"
    when = period_in_words(curves.calendar, float(curves.time[first]), float(curves.time[last]))
    again = f"; {counted(times - 1, 'other period')} shown lie beyond it" if times > 1 else ""
    return (
        f"The {one.short} estimate of {module} stands {number(abs(apart))} l/h {side} the "
        f"{other.short} estimate {when}, {_compared(curves, i, run, apart)}{again}."
    )


def _compared(curves: Curves, row: int, run: slice, apart: float) -> str:
    """The distance relative to the baseline, if that differs, and the threshold."""
    value, threshold = (
        float(np.mean(table[row, run])) for table in (curves.values, curves.thresholds)
    )
    beyond = f"beyond the threshold of {number(threshold, 2)} l/h"
    if np.isclose(value, apart, rtol=1e-9):
        return beyond
    way = "up" if value > 0 else "down"
    return f"{way} by {number(abs(value))} l/h against what was taken for fault-free, {beyond}"


def excess(curves: Curves, row: int, runs: Sequence[tuple[int, int]]) -> float:
    """Ratio of a residual to its threshold, averaged over each run: the largest."""
    parts = (slice(first, last + 1) for first, last in runs)
    values, thresholds = np.abs(curves.values[row]), curves.thresholds[row]
    return max(float(np.mean(values[part] / thresholds[part])) for part in parts)


def say_residuals(curves: Curves) -> str:
    """Which residuals exceed their thresholds, and how far."""
    formed = int(curves.formed().sum())
    if not curves.judged.any():
        return "No sample was judged, so no residual counts as fired."
    found = sorted(
        ((excess(curves, i, runs), curves.residuals[i].id) for i, runs in persistent(curves)),
        reverse=True,
    )
    lost = [r.id for r, ok in zip(curves.residuals, curves.formed(), strict=True) if not ok]
    absent = f"; {_some(lost)} could not be formed" if lost else ""
    if not found:
        if not formed:
            return "No residual could be formed."
        none = "The residual never exceeds"
        if formed > 1:
            none = f"None of the {formed} residuals exceeds"
        return f"{none} its threshold for three samples in a row{absent}."
    names = _some([f"{name} ({number(times, 2)} times its threshold)" for times, name in found])
    rest = formed - len(found)
    brief = " but for one or two samples" if curves.fired().any(axis=1).sum() > len(found) else ""
    stay = f"; the other {rest} stay{'s' * (rest == 1)} inside{brief}" if rest else ""
    return f"{names} leave{'s' * (len(found) == 1)} the shaded zero band{stay}{absent}."


def _some(names: Sequence[str]) -> str:
    more = [counted(len(names) - NAMED, "other")] if len(names) > NAMED else []
    return listed([*names[:NAMED], *more])


def say_degrees(diagnosis: Diagnosis, missed: Sequence[str]) -> str:
    """How large each diagnosed fault becomes, and when; `missed` were there but not named."""
    findings, worst = diagnosis.findings, worst_first(diagnosis.findings)
    if not diagnosis.judged:
        return "Nothing was judged, so no degree is known."
    if not worst:
        absent = f", although {_some(missed)} was there" if missed else ""
        return f"No fault was diagnosed{absent}."
    parts = []
    for finding in worst:
        times = sum(f.fault.id == finding.fault.id for f in findings)
        often = f", the largest of {times} findings" if times > 1 else ""
        parts.append(
            f"{finding.fault.id} reaches {degree(finding.degree, finding.fault.unit)} "
            f"({bounds(finding.lower, finding.upper)}) "
            f"{period_in_words(diagnosis.calendar, finding.since, finding.until)}{often}"
        )
    if missed:
        parts.append(f"truly present but never named: {_some(missed)}")
    return "; ".join(parts) + "."


def say_cases(cases: Cases) -> str:
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


def say_shares(cases: Cases, table: np.ndarray) -> str:
    """Shares of the cases close to the truth."""
    middle = len(table) // 2
    near, next_to = table[middle].sum(), table[middle - 1 : middle + 2].sum()
    return (
        f"{percent(float(near))} of {counted(len(cases), 'case')} lie within 0.05 of the true "
        f"degree and {percent(float(next_to))} within 0.15; the mean absolute discrepancy is "
        f"{number(float(np.abs(cases.discrepancy).mean()), 2)}."
    )
