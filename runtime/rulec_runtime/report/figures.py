"""Draw what happened over time: Figures 7 to 9 of the seed paper, for one recording."""

from collections.abc import Iterator

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.verdict_per_sample import Trace
from rulec_runtime.report.chart import Axis, Panel, axis, labels_apart
from rulec_runtime.report.compare import draw_cases
from rulec_runtime.report.figure import Figure
from rulec_runtime.report.series import NOT_JUDGED, Curves, detail, excess
from rulec_runtime.report.text import counted, listed, number
from rulec_runtime.report.text import degree as degree_text
from rulec_runtime.report.thin_curves import COLUMNS, thin_band, thin_marks, thin_series
from rulec_runtime.report.time_axis import over, time_plot
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
    across = over(curves.time, curves.calendar)
    panel = Panel(across, _range(curves, low, high), 260)
    bands, lines, ends = [], [], []
    for i, flow in enumerate(curves.flows):
        bands.append(panel.band(*thin_band(curves.time, low[i], high[i]), f"s{i % 6}"))
        lines.append(panel.curve(*thin_series(curves.time, flow), f"s{i % 6}"))
        finite = flow[np.isfinite(flow)]
        ends.append(float(np.clip(finite[-1], panel.y.low, panel.y.high)) if len(finite) else None)
    names = labels_apart(panel, ends, [side.short for side in curves.sides])
    module = curves.sides[0].module
    drawn = [_unjudged(panel, curves.time, curves.judged), *bands, *lines]
    svg = panel.drawn(f"flow estimates of {module}", "flow [l/h]", drawn, [names], True)
    key = ["band: 95 % uncertainty"]
    key += [f"{s.short} = {' + '.join(s.observers)}" for s in curves.sides if s.observers[1:]]
    if len(curves.time) < len(whole.time):
        where = "around the largest finding" if curves.focus else "at the beginning"
        samples = counted(len(curves.time), "sample")
        key.append(f"{samples} {where}, the whole recording is below")
    key += _grey(curves.time, curves.judged)
    return Figure(
        name="estimates",
        title=f"Flow estimates of {module}",
        key="; ".join(key),
        body=time_plot(svg, True, across),
        caption=f"Estimates of the flow through {module}, which should agree.",
    )


def draw_residuals(curves: Curves) -> Figure:
    """Residuals over time, one panel each, with the zero band and marks where they fire."""
    beyond = excess(curves)
    drawable = np.flatnonzero(np.isfinite(curves.values).any(axis=1)).tolist()
    parts = [_residual_panel(curves, i, beyond.get(i, 0.0), i == drawable[-1]) for i in drawable]
    key = ["shaded: within the threshold", "▲ fired upwards, ▼ downwards"]
    key += ["zero: what was taken for fault-free"] if curves.learned else []
    key += ["only judged samples are drawn"] if _is_long(curves.time) else []
    key += _grey(curves.time, curves.judged)
    return Figure(
        name="residuals",
        title="Residuals",
        key="; ".join(key),
        body="".join(parts),
        caption="Differences between estimates of the same flow, beside their thresholds.",
        tall=True,
    )


def _residual_panel(curves: Curves, row: int, times: float, last: bool) -> str:
    """One residual; `times` is its `excess` where it persists, 0 if it never does."""
    value, threshold = curves.values[row], curves.thresholds[row]
    if _is_long(curves.time):
        # Transients are much larger than faults: in a long recording they would hide everything.
        value, threshold = (np.where(curves.judged, part, np.nan) for part in (value, threshold))
    across = over(curves.time, curves.calendar)
    shown = _range(curves, np.fmin(value, -threshold), np.fmax(value, threshold), 3)
    panel = Panel(across, shown, 76)
    drawn = [
        _unjudged(panel, curves.time, curves.judged),
        panel.band(*thin_band(curves.time, -threshold, threshold), "zero"),
        panel.curve(*thin_series(curves.time, value), "plain"),
    ]
    fired = curves.fired()[row]
    state = "brief" if fired.any() else "inside"
    state = state if curves.formed()[row] else "not judged"
    words = (f"{number(times, 2)} ×", "threshold") if times else (state, "")
    fixed = [panel.beside(*words, bool(times))]
    for symbol, chosen in (("up", fired & (value > 0)), ("down", fired & (value < 0))):
        index = thin_marks(curves.time, np.abs(value), chosen, MARKS)
        fixed.append(panel.marks(curves.time[index], value[index], symbol, "fired"))
    name = curves.residuals[row].id
    svg = panel.drawn(name, f"{name} [l/h]", drawn, fixed, last)
    return time_plot(svg, last, across)


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
    parts = [
        _degree_panel(diagnosis, trace, truth, name, i == len(names) - 1)
        for i, name in enumerate(names)
    ]
    key = ["● named as the cause", "band: 95 % bounds"]
    key += ["dashed: truth"] if truth is not None else []
    key += _grey(trace.time, _with_degree(trace))
    unnamed = f" Truly present but never named: {listed(missed)}." if missed else ""
    return Figure(
        name="degrees",
        title="Degree of the diagnosed faults",
        key="; ".join(key),
        body="".join(parts),
        caption=f"The course of each fault.{unnamed}",
    )


def _degree_panel(
    diagnosis: Diagnosis, trace: Trace, truth: Truth | None, name: str, last: bool
) -> str:
    judged = _with_degree(trace)
    degree, low, high = (np.where(judged, values, np.nan) for values in trace.of(name))
    true = np.full(len(degree), np.nan)
    unit = diagnosis.ruleset.fault_by_id[name].unit
    if truth is not None and name in truth.faults:
        true = truth.degree[truth.faults.index(name)]
    top = float(np.nanmax([np.fmax(high, true)], initial=0.05))
    across = over(trace.time, diagnosis.calendar)
    panel = Panel(across, axis(0.0, 1.1 * top, 4), 150)
    drawn = [
        _unjudged(panel, trace.time, judged),
        panel.band(*thin_band(trace.time, low, high), "s0"),
        panel.curve(*thin_series(trace.time, degree), "s0"),
        panel.curve(*thin_series(trace.time, true), "truth"),
    ]
    here = np.array([name in names for names in names_at(trace)], dtype=bool)
    index = thin_marks(trace.time, degree, here, MARKS)
    fixed = [panel.marks(trace.time[index], degree[index], "disc", "s0")]
    found = [f for f in diagnosis.findings if f.fault.id == name]
    for f in found if len(found) <= LABELLED else ():
        label = degree_text(f.degree, f.fault.unit)
        fixed.append(panel.text((f.since + f.until) / 2, f.upper, label, "value", -5))
    svg = panel.drawn(name, f"{name}, degree [{unit or 1}]", drawn, fixed, last)
    return time_plot(svg, last, across)


def _with_degree(trace: Trace) -> np.ndarray:
    """Samples at which a degree, perhaps 0, was found."""
    result: np.ndarray = ~np.isin(np.array(trace.verdict), (*NOT_JUDGED, "unknown"))
    return result


def _is_long(time: Array) -> bool:
    return len(time) > 2 * COLUMNS


def _range(curves: Curves, low: Array, high: Array, ticks: int = 5) -> Axis:
    """Vertical axis over the judged samples; a long recording loses its extreme values."""
    chosen = curves.judged if curves.judged.any() else np.ones(len(curves.time), dtype=bool)
    lows, highs = low[..., chosen], high[..., chosen]
    lows, highs = lows[np.isfinite(lows)], highs[np.isfinite(highs)]
    if not len(lows):
        return axis(0.0, 1.0, ticks)
    cut = 0.5 if _is_long(curves.time) else 0.0
    return axis(float(np.percentile(lows, cut)), float(np.percentile(highs, 100 - cut)), ticks)


def _unjudged(panel: Panel, time: Array, judged: np.ndarray) -> str:
    """Grey where nothing was judged; not in long recordings, where it would blur."""
    return "" if _is_long(time) or len(time) < 2 else panel.spans(time, ~judged, "unjudged")


def _grey(time: Array, judged: np.ndarray) -> list[str]:
    drawn = not _is_long(time) and not judged.all()
    return ["grey: not settled, or not judged"] if drawn else []
