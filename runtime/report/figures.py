"""The pictures of the seed paper (Figures 7 to 11), made from one recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from runtime.diagnose import Diagnosis, Trace
from runtime.plan import Array
from runtime.report.captions import (
    say_cases,
    say_degrees,
    say_estimates,
    say_residuals,
    say_shares,
)
from runtime.report.chart import Axis, Panel, axis, labels_apart
from runtime.report.series import NOT_JUDGED, Curves
from runtime.report.text import safe
from runtime.report.thin import COLUMNS, thin_band, thin_marks, thin_series
from runtime.report.truth import DEGREES, ROWS, Cases, Truth, shares
from runtime.runs import COVERAGE
from runtime.wording import worst_first

MARKS = 90
"""Marks across a panel at most, so that they stay apart."""

POINTS = 60
"""Cells of a scatter plot in each direction; one mark a cell."""


@dataclass(frozen=True)
class Figure:
    """A picture as HTML, its title, how to read it, and the sentence below it."""

    name: str
    title: str
    key: str
    body: str
    caption: str
    narrow: bool = False
    tall: bool = False


def figures_of(
    diagnosis: Diagnosis, curves: Curves, trace: Trace, truth: Truth | None, cases: Cases | None
) -> Iterator[Figure]:
    """All figures that the data allow, in the order of the paper."""
    time = axis(float(curves.time[0]), float(curves.time[-1]), 9, tight=True)
    if curves.sides:
        yield draw_estimates(curves, time)
    if curves.residuals:
        yield draw_residuals(curves, time)
    yield draw_degrees(diagnosis, trace, truth, time)
    if cases is not None and len(cases):
        yield draw_cases(cases)
        yield draw_shares(cases)


def draw_estimates(curves: Curves, time: Axis) -> Figure:
    """Flow estimates of one module with their 95 % bands."""
    spread = COVERAGE * curves.flows_u
    panel = Panel(time, _range(curves, curves.flows - spread, curves.flows + spread), 260)
    drawn = [_unjudged(panel, curves.time, curves.judged)]
    ends = []
    for i, (flow, half) in enumerate(zip(curves.flows, spread, strict=True)):
        drawn.append(panel.band(*thin_band(curves.time, flow - half, flow + half), f"s{i % 6}"))
        finite = flow[np.isfinite(flow)]
        ends.append(float(np.clip(finite[-1], panel.y.low, panel.y.high)) if len(finite) else None)
    for i, flow in enumerate(curves.flows):
        drawn.append(panel.curve(*thin_series(curves.time, flow), f"s{i % 6}"))
    names = labels_apart(panel, ends, [side.short for side in curves.sides])
    module = curves.sides[0].module
    svg = panel.drawn(f"flow estimates of {module}", "flow [l/h]", drawn, [names], True)
    sums = [f"{s.short} = {' + '.join(s.observers)}" for s in curves.sides if len(s.observers) > 1]
    key = "; ".join(["band: 95 % uncertainty", *sums, *_grey(curves)])
    return Figure(
        "estimates", f"Flow estimates of {module}", key, _plot(svg, True), say_estimates(curves)
    )


def draw_residuals(curves: Curves, time: Axis) -> Figure:
    """Residuals over time, one panel each, with the zero band and marks where they fire."""
    fired, parts = curves.fired(), []
    for i, residual in enumerate(curves.residuals):
        value, limit = curves.values[i], curves.limits[i]
        panel = Panel(time, _range(curves, np.fmin(value, -limit), np.fmax(value, limit), 2), 76)
        drawn = [
            _unjudged(panel, curves.time, curves.judged),
            panel.band(*thin_band(curves.time, -limit, limit), "zero"),
            panel.curve(*thin_series(curves.time, value), "plain"),
        ]
        marks = []
        for symbol, chosen in (("up", fired[i] & (value > 0)), ("down", fired[i] & (value < 0))):
            index = thin_marks(curves.time, np.abs(value), chosen, MARKS)
            marks.append(panel.marks(curves.time[index], value[index], symbol, "fired"))
        last = i == len(curves.residuals) - 1
        title = f"{residual.id} [l/h]"
        parts.append(_plot(panel.drawn(residual.id, title, drawn, marks, last), last))
    total = len(curves.residuals)
    key = "; ".join(
        ["shaded: zero within its limit", "▲ fired upwards", "▼ fired downwards", *_grey(curves)]
    )
    return Figure(
        "residuals", f"Residuals ({total})", key, "".join(parts), say_residuals(curves), tall=True
    )


def draw_degrees(diagnosis: Diagnosis, trace: Trace, truth: Truth | None, time: Axis) -> Figure:
    """Degree of each diagnosed fault with 95 % bounds; dashed the truth."""
    worst = worst_first(diagnosis.findings)
    names = [f.fault.id for f in worst]
    if truth is not None:
        present = np.nan_to_num(truth.degree).max(axis=1) > 0
        names += [n for n, p in zip(truth.faults, present, strict=True) if p and n not in names]
    words = np.array(trace.verdict)
    judged = ~np.isin(words, NOT_JUDGED)
    rows = {f.id: i for i, f in enumerate(diagnosis.ruleset.faults)}
    parts = []
    for place, name in enumerate(names):
        i = rows[name]
        degree = np.where(judged, trace.degree[i], np.nan)
        low, high = trace.lower[i], trace.upper[i]
        true = None
        if truth is not None:
            true = truth.degree[truth.faults.index(name)] if name in truth.faults else None
        top = max(float(np.nanmax(t, initial=0.05)) for t in (degree, high, true) if t is not None)
        panel = Panel(time, axis(0.0, top, 4), 150)
        drawn = [
            _unjudged(panel, trace.time, judged),
            panel.band(
                *thin_band(trace.time, *(np.where(judged, b, np.nan) for b in (low, high))), "s0"
            ),
            panel.curve(*thin_series(trace.time, degree), "s0"),
        ]
        if true is not None:
            drawn.append(panel.curve(*thin_series(trace.time, true), "truth"))
        index = thin_marks(trace.time, degree, words == name, MARKS)
        marks = panel.marks(trace.time[index], degree[index], "disc", "s0")
        last = place == len(names) - 1
        parts.append(_plot(panel.drawn(name, f"{name}, degree [1]", drawn, [marks], last), last))
    key = "● named as the cause; band: 95 % bounds"
    key += "; dashed: truth" if truth is not None else ""
    return Figure(
        "degrees",
        "Degree of the diagnosed faults",
        key if names else "",
        "".join(parts),
        say_degrees(diagnosis.findings, worst),
    )


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
    body = _plot(svg, True, "true degree [1]")
    key = "● rightly named, with 95 % bounds; × another fault, none or a false alarm; dashed: truth"
    return Figure("cases", "Diagnosed against true degree", key, body, say_cases(cases), True)


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
    body = (
        '<div class="scroll"><table class="shares"><thead><tr><th>discrepancy</th>'
        f'<th colspan="{len(DEGREES) + 1}" scope="colgroup">true degree</th></tr>'
        f'<tr><th scope="col">diagnosed − true</th>{head}</tr></thead><tbody>{"".join(rows)}'
        f'<tr class="total"><th scope="row">total</th>{foot}</tr></tbody></table></div>'
    )
    key = "share of cases; bins centred as written, the outer ones open"
    return Figure("shares", "Discrepancy", key, body, say_shares(cases, table), True)


def _signed(value: float) -> str:
    return "0" if value == 0 else f"{value:+.1f}".replace("-", "−")


def _cell(share: float, shaded: bool = True) -> str:
    """A share as a cell; the larger the darker."""
    tint = f' style="--tint:{round(100 * min(share / 0.3, 1))}%"' if shaded and share > 0 else ""
    return f"<td{tint}>{f'{share:.2f}' if share > 0 else '·'}</td>"


def _one_a_cell(cases: Cases, chosen: np.ndarray, top: float) -> np.ndarray:
    """Of the cases that would lie on one another one each."""
    index = np.flatnonzero(chosen)
    cells = np.stack([cases.true[index], cases.degree[index]]) * (POINTS / top)
    _, first = np.unique(np.floor(cells), axis=1, return_index=True)
    return index[np.sort(first)]


def _range(curves: Curves, low: Array, high: Array, ticks: int = 5) -> Axis:
    """Vertical axis that holds what was judged; of long recordings all but the wildest."""
    seen = curves.judged if curves.judged.any() else np.ones(len(curves.time), dtype=bool)
    lows, highs = low[..., seen], high[..., seen]
    lows, highs = lows[np.isfinite(lows)], highs[np.isfinite(highs)]
    if not len(lows):
        return axis(0.0, 1.0, ticks)
    cut = 0.5 if len(curves.time) > 2 * COLUMNS else 0.0
    return axis(float(np.percentile(lows, cut)), float(np.percentile(highs, 100 - cut)), ticks)


def _unjudged(panel: Panel, time: Array, judged: np.ndarray) -> str:
    """Grey where nothing was judged; left out of long recordings, where it would be a blur."""
    if len(time) > 2 * COLUMNS or len(time) < 2:
        return ""
    edges = np.concatenate([time[:1], (time[1:] + time[:-1]) / 2, time[-1:]])
    x = np.repeat(edges, 2)[1:-1]
    there = np.where(np.repeat(judged, 2), np.nan, 1.0)
    return panel.band(x, panel.y.low * there, panel.y.high * there, "unjudged")


def _grey(curves: Curves) -> Sequence[str]:
    drawn = len(curves.time) <= 2 * COLUMNS and not curves.judged.all()
    return ("grey: not settled or not judged",) if drawn else ()


def _plot(svg: str, foot: bool, below: str = "time [s]") -> str:
    """A panel with room for its axes; the last one of a stack says what the horizontal axis is."""
    label = f'<div class="below">{safe(below)}</div>' if foot else ""
    return f'<div class="plot{" foot" if foot else ""}">{svg}{label}</div>'
