"""Draw what happened over time: Figures 7 to 9 of the seed paper, for one recording."""

from collections.abc import Iterator

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.verdict_per_sample import Trace
from rulec_runtime.report.chart import Figure, Panel, axis, holding
from rulec_runtime.report.compare import draw_cases
from rulec_runtime.report.series import NOT_JUDGED, Curves, detail, excess
from rulec_runtime.report.text import counted, listed, number
from rulec_runtime.report.text import degree as degree_text
from rulec_runtime.report.thin_curves import is_long, thin_marks
from rulec_runtime.report.time_axis import over
from rulec_runtime.report.truth import Cases, Truth, names_at
from rulec_runtime.report.wording import worst_first

MARKS = 90
"""Most marks across a panel, so that they stay apart."""

LABELLED = 6
"""Most findings of one fault for which the picture shows the degrees as numbers."""


def figures_of(
    diagnosis: Diagnosis, curves: Curves, trace: Trace, truth: Truth | None, cases: Cases | None
) -> Iterator[Figure]:
    """All figures that the data allow, in the order of the paper."""
    if np.isfinite(curves.flows).any():
        yield draw_estimates(curves)
    if np.isfinite(curves.values).any():
        yield draw_residuals(curves)
    if diagnosed := draw_degrees(diagnosis, trace, truth):
        yield diagnosed
    if cases is not None and len(cases):
        yield draw_cases(cases)


def draw_estimates(whole: Curves) -> Figure:
    """Flow estimates of one module with 95 % bands; a part of a long recording."""
    curves = detail(whole)
    spread = limits.COVERAGE * curves.flows_u
    low, high = curves.flows - spread, curves.flows + spread
    module, across = curves.sides[0].module, over(curves.time, curves.calendar)
    down = holding(*_judged(curves, low, high), title=f"flow [{curves.unit.name}]")
    panel = Panel(f"flow estimates of {module}", across, down, 260)
    _grey(panel, curves.time, curves.judged)
    named = [
        (side.short, flow, f"s{i % 6}")
        for i, (side, flow) in enumerate(zip(curves.sides, curves.flows, strict=True))
    ]
    for lower, upper, (_, _, style) in zip(low, high, named, strict=True):
        panel.course_band(curves.time, lower, upper, style)
    for _, flow, style in named:
        panel.course(curves.time, flow, style)
    panel.labels(named)
    key = ["band: 95 % uncertainty"]
    key += [f"{s.short} = {' + '.join(s.observers)}" for s in curves.sides if s.observers[1:]]
    if len(curves.time) < len(whole.time):
        where = "around the largest finding" if curves.focus else "at the beginning"
        samples = counted(len(curves.time), "sample")
        key.append(f"{samples} {where}, the whole recording is below")
    return Figure(
        name="estimates",
        title=f"Flow estimates of {module}",
        key=[*key, *_grey_words(curves.time, curves.judged)],
        panels=[panel],
        caption=f"Estimates of the flow through {module}, which should agree.",
    )


def draw_residuals(curves: Curves) -> Figure:
    """Residuals over time, one panel each, with the zero band and marks where they fire."""
    beyond = excess(curves)
    drawable = np.flatnonzero(np.isfinite(curves.values).any(axis=1)).tolist()
    key = ["shaded: within the threshold", "▲ fired upwards, ▼ downwards"]
    key += ["zero: what was taken for fault-free"] if curves.learned else []
    key += ["only judged samples are drawn"] if is_long(curves.time) else []
    return Figure(
        name="residuals",
        title="Residuals",
        key=[*key, *_grey_words(curves.time, curves.judged)],
        panels=[_residual_panel(curves, i, beyond.get(i, 0.0)) for i in drawable],
        caption="Differences between estimates of the same flow, beside their thresholds.",
    )


def _residual_panel(curves: Curves, row: int, times: float) -> Panel:
    """One residual; `times` is its `excess` where it persists, 0 if it never does."""
    value, threshold, name = curves.values[row], curves.thresholds[row], curves.residuals[row].id
    if is_long(curves.time):
        # Transients are much larger than faults: in a long recording they would hide everything.
        value, threshold = (np.where(curves.judged, part, np.nan) for part in (value, threshold))
    ends = _judged(curves, np.fmin(value, -threshold), np.fmax(value, threshold))
    down = holding(*ends, ticks=3, title=f"{name} [{curves.unit.name}]")
    panel = Panel(name, over(curves.time, curves.calendar), down, 76)
    _grey(panel, curves.time, curves.judged)
    panel.course_band(curves.time, -threshold, threshold, "zero")
    panel.course(curves.time, value, "plain")
    fired = curves.fired()[row]
    state = "brief" if fired.any() else "inside"
    state = state if curves.formed()[row] else "not judged"
    panel.beside(*((f"{number(times, 2)} ×", "threshold") if times else (state, "")), bool(times))
    for symbol, chosen in (("up", fired & (value > 0)), ("down", fired & (value < 0))):
        index = thin_marks(curves.time, np.abs(value), chosen, MARKS)
        panel.marks(curves.time[index], value[index], symbol, "fired")
    return panel


def draw_degrees(diagnosis: Diagnosis, trace: Trace, truth: Truth | None) -> Figure | None:
    """Degree of each diagnosed fault with 95 % bounds, and the dashed truth; None without any."""
    names = [f.fault.id for f in worst_first(diagnosis.findings)]
    missed: list[str] = []
    if truth is not None:
        present = np.nan_to_num(truth.degree).max(axis=1) > 0
        true = [name for name, p in zip(truth.faults, present, strict=True) if p]
        reported = {name for here in names_at(trace) for name in here}
        reported |= {f.fault.id for f in diagnosis.findings}
        missed = [name for name in true if name not in reported]
        names += [name for name in true if name not in names]
    if not names:
        return None
    key = ["● named as the cause", "band: 95 % bounds"]
    key += ["dashed: truth"] if truth is not None else []
    unnamed = f" Truly present but never named: {listed(missed)}." if missed else ""
    return Figure(
        name="degrees",
        title="Degree of the diagnosed faults",
        key=[*key, *_grey_words(trace.time, _with_degree(trace))],
        panels=[_degree_panel(diagnosis, trace, truth, name) for name in names],
        caption=f"The course of each fault.{unnamed}",
    )


def _degree_panel(diagnosis: Diagnosis, trace: Trace, truth: Truth | None, name: str) -> Panel:
    judged = _with_degree(trace)
    degree, low, high = (np.where(judged, values, np.nan) for values in trace.of(name))
    true = np.full(len(degree), np.nan)
    unit = diagnosis.ruleset.fault_by_id[name].unit
    if truth is not None and name in truth.faults:
        true = truth.degree[truth.faults.index(name)]
    top = float(np.nanmax([np.fmax(high, true)], initial=0.05))
    down = axis(0.0, 1.1 * top, 4, title=f"{name}, degree [{unit or 1}]")
    panel = Panel(name, over(trace.time, diagnosis.calendar), down, 150)
    _grey(panel, trace.time, judged)
    panel.course_band(trace.time, low, high, "s0")
    panel.course(trace.time, degree, "s0")
    panel.course(trace.time, true, "truth")
    here = np.array([name in names for names in names_at(trace)], dtype=bool)
    index = thin_marks(trace.time, degree, here, MARKS)
    panel.marks(trace.time[index], degree[index], "disc", "s0")
    found = [f for f in diagnosis.findings if f.fault.id == name]
    for f in found if len(found) <= LABELLED else ():
        label = degree_text(f.degree, f.fault.unit)
        panel.text((f.since + f.until) / 2, f.upper, label, "value", -5)
    return panel


def _with_degree(trace: Trace) -> np.ndarray:
    """Samples at which a degree, perhaps 0, was found."""
    result: np.ndarray = ~np.isin(np.array(trace.verdict), (*NOT_JUDGED, "unknown"))
    return result


def _judged(curves: Curves, *values: Array) -> Iterator[Array]:
    """Values, shape (..., n), at the judged samples only, if there are any."""
    chosen = curves.judged if curves.judged.any() else np.ones(len(curves.time), dtype=bool)
    return (part[..., chosen] for part in values)


def _grey(panel: Panel, time: Array, judged: np.ndarray) -> None:
    """Grey where nothing was judged; not in long recordings, where it would blur."""
    if not is_long(time) and len(time) > 1:
        panel.spans(time, ~judged, "unjudged")


def _grey_words(time: Array, judged: np.ndarray) -> list[str]:
    drawn = not is_long(time) and not judged.all()
    return ["grey: not settled, or not judged"] if drawn else []
