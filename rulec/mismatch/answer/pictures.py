"""Pictures of a comparison: over time, over what drives it, predicted against measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.wall_clock import Calendar
from rulec_runtime.report.chart import Axis, Panel, axis, labels_apart
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.thin_curves import COLUMNS, columns_of, thin_series
from rulec_runtime.report.time_axis import over, time_plot

from rulec.effects.candidate import TIME
from rulec.mismatch.answer.captions import (
    say_agreement,
    say_detail,
    say_driver,
    say_hidden,
    say_periods,
    say_shape,
    say_time,
)
from rulec.mismatch.answer.picture_data import (
    Drawn,
    curves_of,
    detail_of,
    followed_by,
    middle_by,
    telling_drivers,
)
from rulec.mismatch.answer.wording import titled
from rulec.mismatch.result import Finding, HiddenDriver, Location, Mismatch, Period, Shape

DRIVERS = 4
"""Drivers drawn."""

CELLS = (160, 60)
"""Cells of a cloud of points across and down; one point a cell."""

LOUDEST = 0.2
"""Percent of the points at either end that may lie beyond a panel where there are many."""

MODELS = (("repaired", "s0"), ("recalibrated", "s1"), ("shipped", "s5"))
"""Curves and their styles; the number of a style is that of its label."""


def pictures_of(
    mismatch: Mismatch, calendar: Calendar | None = None
) -> tuple[list[Figure], list[Figure]]:
    """All pictures that the comparison allows: first those over what the mismatch depends on."""
    drawn = curves_of(mismatch)
    shapes = [(at, at.shape) for at in mismatch.locations if at.shape is not None]
    shapes = [(at, shape) for at, shape in shapes if shape.driver != TIME]
    first = [_left_out(location, shape, i) for i, (location, shape) in enumerate(shapes)]
    then: list[Figure] = []
    if drawn is not None:
        then.append(
            _over_time(drawn, "time", f"{drawn.signal} over time", say_time(drawn), calendar)
        )
        if len(drawn.time) > 2 * COLUMNS:
            part = detail_of(drawn)
            title = f"{drawn.signal} in detail"
            then.append(_over_time(part, "detail", title, say_detail(part, calendar), calendar))
        followed = followed_by(mismatch, drawn)
        titles = [*followed, *(t for t in telling_drivers(drawn) if t not in followed)]
        for i, title in enumerate(titles[:DRIVERS]):
            one = _over_driver(drawn, i, title, drawn.drivers[title])
            (first if i == 0 and followed else then).append(one)
        then.append(_agreement(drawn))
    for i, finding in enumerate(mismatch.findings):
        periods = [p for p in finding.periods if np.isfinite([p.since, p.until, p.degree]).all()]
        if periods:
            then.append(_periods(drawn, finding, periods, i, calendar))
    if mismatch.hidden is not None and np.isfinite(mismatch.hidden.course).any():
        then.append(_course(mismatch.hidden, calendar))
    return first, then


def _left_out(location: Location, shape: Shape, index: int) -> Figure:
    """What is left out at a place over its driver: the curve, its band, and single means."""
    at, low, high = shape.at, shape.value - 2.0 * shape.u, shape.value + 2.0 * shape.u
    z, v, u = shape.means.T
    across = axis(float(at[0]), float(at[-1]), 8, tight=True)
    panel = Panel(across, _holding(low, high, v, np.zeros(1)), 240)
    lines = [
        panel.band(at, low, high, "s0"),
        panel.bars(z, v - 2.0 * u, v + 2.0 * u, "s1"),
        panel.curve(at, shape.value, "s0"),
    ]
    place = f"{location.module}.{location.place}"
    unit, of_driver = ("" if own == "1" else f" [{own}]" for own in (shape.unit, shape.driver_unit))
    title = f"What is left out at {place} over {shape.driver}"
    marks = [panel.marks(z, v, "disc", "s1")]
    svg = panel.drawn(title, f"missing in {place}{unit}", lines, marks, True)
    return Figure(
        name=f"shape{index}",
        title=title,
        key="blue: what the law would have to add, with its 95 % band; orange: means of "
        "operating states, with their 95 % bars",
        body=plot(svg, True, f"{shape.driver}{of_driver}"),
        caption=say_shape(shape),
        narrow=True,
    )


def _over_time(
    drawn: Drawn, name: str, title: str, caption: str, calendar: Calendar | None
) -> Figure:
    """Measured against the models, and below it what each leaves."""
    errors = [drawn.measured - drawn.repaired, drawn.measured - drawn.recalibrated]
    across = over(drawn.time, calendar)
    upper = Panel(across, _holding(drawn.measured, drawn.recalibrated), 240)
    lower = Panel(across, _holding(drawn.repaired_error, drawn.recalibrated_error), 130)
    lines: list[str] = []
    ends: list[float | None] = [None] * 6
    for model, style in reversed(MODELS):
        values = getattr(drawn, model)
        lines.append(upper.curve(*thin_series(drawn.time, values), style))
        ends[int(style[1:])] = _end(upper, values)
    lines.append(upper.curve(*thin_series(drawn.time, drawn.measured), "plain"))
    names = labels_apart(upper, ends, ["repaired", "recalibrated", "", "", "", "as shipped"])
    left = [
        lower.curve(*thin_series(drawn.time, values), style)
        for values, style in zip(errors[::-1], ("s1", "s0"), strict=True)
    ]
    shades = [_shades(drawn, panel) for panel in (upper, lower)]
    titles = (f"{drawn.signal}{drawn.in_unit}", f"measured less predicted{drawn.in_unit}")
    above = upper.drawn(title, titles[0], [*shades[0], *lines], [names], False)
    error = f"error of {drawn.signal}"
    below = lower.drawn(error, titles[1], [*shades[1], *left], [], True)
    body = time_plot(above, False, across, calendar) + time_plot(below, True, across, calendar)
    key = ["thin: measured"]
    key += ["shaded: where the mismatch was located"] if drawn.located.any() else []
    key += ["grey at the foot: held out"] if drawn.heldout.any() else []
    return Figure(name=name, title=title, key="; ".join(key), body=body, caption=caption)


def _shades(drawn: Drawn, panel: Panel) -> list[str]:
    """Where the mismatch was located, and what was held out."""
    time, flags = drawn.time, [drawn.located, drawn.heldout]
    if len(time) > 2 * COLUMNS:
        columns = columns_of(time)
        time = columns.centre
        flags = [columns.highest(flag.astype(float)) > 0 for flag in flags]
    return [
        panel.spans(time, flags[0], "located"),
        panel.spans(time, flags[1], "heldout", 0.05),
    ]


def _over_driver(drawn: Drawn, index: int, title: str, readings: Array) -> Figure:
    """Errors against a driver, recalibrated above and repaired below, on one scale."""
    before, after = drawn.recalibrated_error, drawn.repaired_error
    across, down = _holding(readings), _holding(before, after)
    rows = [(before, "recalibrated", "s1")]
    rows += [(after, "repaired", "s0")] if drawn.is_repaired else []
    parts = []
    for values, words, style in rows:
        panel, last = Panel(across, down, 150), words == rows[-1][1]
        cloud = panel.curve(*_cloud(panel, readings, values), f"dots {style}")
        trend = panel.curve(*middle_by(readings, values), "plain")
        heading = f"measured less {words}{drawn.in_unit}"
        svg = panel.drawn(f"error of the {words} model", heading, [cloud, trend], [], last)
        parts.append(plot(svg, last, title))
    key = "line: median"
    if drawn.is_repaired:
        key = f"above before the repair, below after it; {key}"
    return Figure(
        name=f"driver{index}",
        title=f"Error over {title}",
        key=key,
        body="".join(parts),
        caption=say_driver(drawn, title, readings),
        narrow=True,
    )


def _agreement(drawn: Drawn) -> Figure:
    """Predicted against measured; a perfect model lies on the diagonal."""
    scale = _holding(drawn.measured, drawn.recalibrated, drawn.repaired)
    panel = Panel(scale, scale, 320)
    ends = np.array([scale.low, scale.high])
    lines = [
        panel.curve(*_cloud(panel, drawn.measured, getattr(drawn, model)), f"dots {style}")
        for model, style in (("recalibrated", "s1"), ("repaired", "s0"))
    ]
    heading = f"predicted {drawn.signal}{drawn.in_unit}"
    svg = panel.drawn(
        "predicted against measured", heading, [*lines, panel.curve(ends, ends, "truth")], [], True
    )
    key = "orange: recalibrated; dashed: perfect"
    if drawn.is_repaired:
        key = f"blue: repaired; {key}"
    body = plot(svg, True, f"measured {drawn.signal}{drawn.in_unit}")
    return Figure(
        name="agreement",
        title="Predicted against measured",
        key=key,
        body=body,
        caption=say_agreement(drawn),
        narrow=True,
    )


def _periods(
    drawn: Drawn | None,
    finding: Finding,
    found: Sequence[Period],
    index: int,
    calendar: Calendar | None,
) -> Figure:
    """Degree of a fault over time with its 95 % bounds."""
    periods = sorted(found, key=lambda p: p.since)
    time = np.array([t for p in periods for t in (p.since, p.until, p.until)])
    degree = np.array([d for p in periods for d in (_at_first(p, p.degree), p.degree, np.nan)])
    spread = np.array([2 * u for p in periods for u in (_at_first(p, p.u), p.u, p.u)])
    span = np.concatenate([time, drawn.time]) if drawn is not None else time
    across = over(span, calendar)
    panel = Panel(across, _holding(degree - spread, degree + spread, np.zeros(1)), 150)
    lines = [
        panel.band(time, degree - spread, degree + spread, "s0"),
        panel.curve(time, degree, "s0"),
    ]
    name = f"{finding.module}.{finding.name}"
    svg = panel.drawn(name, f"{name}, degree [1]", lines, [], True)
    body = time_plot(svg, True, across, calendar)
    return Figure(
        name=f"periods{index}",
        title=titled(finding),
        key="band: 95 % bounds",
        body=body,
        caption=say_periods(periods, calendar),
    )


def _at_first(period: Period, value: float) -> float:
    """A value of a period where it begins: what grows is nothing there."""
    return 0.0 if period.growth else value


def _course(hidden: HiddenDriver, calendar: Calendar | None) -> Figure:
    """Course of what is not recorded, as the place that it moves shows it."""
    across = over(hidden.time, calendar)
    panel = Panel(across, _holding(hidden.course), 170)
    line = panel.curve(*thin_series(hidden.time, hidden.course), "s0")
    name = f"{hidden.module}.{hidden.place}"
    unit = "" if hidden.unit == "1" else f" [{hidden.unit}]"
    svg = panel.drawn(f"course at {name}", f"shift of {name}{unit}", [line], [], True)
    body = time_plot(svg, True, across, calendar)
    return Figure(
        name="hidden",
        title="Course of what is not recorded",
        key="",
        body=body,
        caption=say_hidden(hidden),
    )


def _cloud(panel: Panel, x: Array, y: Array) -> tuple[Array, Array]:
    """Points apart from one another, one a cell of the panel; NaN between them."""
    sound = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    cells = np.floor(
        np.stack([panel.x.share(x[sound]) * CELLS[0], panel.y.share(y[sound]) * CELLS[1]])
    )
    _, first = np.unique(cells, axis=1, return_index=True)
    chosen = sound[np.sort(first)]
    return np.repeat(x[chosen], 2), np.stack([y[chosen], np.full(len(chosen), np.nan)], 1).ravel()


def _holding(*values: Array) -> Axis:
    """An axis that holds values; where there are many, all but the loudest."""
    seen = np.concatenate(values)
    seen = seen[np.isfinite(seen)]
    if not len(seen):
        return axis(0.0, 1.0, 5)
    cut = LOUDEST if len(seen) > 2 * COLUMNS else 0.0
    return axis(float(np.percentile(seen, cut)), float(np.percentile(seen, 100 - cut)), 5)


def _end(panel: Panel, values: Array) -> float | None:
    finite = values[np.isfinite(values)]
    return float(np.clip(finite[-1], panel.y.low, panel.y.high)) if len(finite) else None
