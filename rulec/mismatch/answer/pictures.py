"""Pictures of a comparison: over time, over drivers, and courses that were not recorded.

The sentence below each is computed from what is drawn.
"""

from dataclasses import dataclass, replace

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.report.chart import Figure, Panel, axis, holding
from rulec_runtime.report.text import counted, number, percent
from rulec_runtime.report.time_axis import over

from rulec.effects.candidate import TIME
from rulec.mismatch.answer.wording import hysteresis, is_repaired, suffix
from rulec.mismatch.inference.heldout_errors import rms
from rulec.mismatch.result import Curves, LatentInput, Location, Mismatch, Shape

BINS = 24
"""Parts of a driver's range, each with its own median."""

FEWEST = 3
"""Points that a median needs."""

DRIVERS = 4
"""Most drivers drawn."""

MODELS = (
    ("shipped", "as shipped", "s5"),
    ("recalibrated", "recalibrated", "s1"),
    ("repaired", "repaired", "s0"),
)
"""Curves, their labels and their styles."""


@dataclass(frozen=True, kw_only=True)
class ReadingCourses:
    """Curves in order of time, in the unit of the signal; `repaired` is NaN without a repair.

    `located`, shape (n,), flags the region or the periods of the mismatch.
    """

    signal: str
    unit: str
    curves: Curves
    located: np.ndarray

    def error(self, model: str) -> Array:
        """Measured minus predicted, shape (n,), NaN where it does not count."""
        c = self.curves
        return np.where(c.inside, c.measured - getattr(c, model), np.nan)

    @property
    def in_unit(self) -> str:
        """The unit in brackets, for an axis."""
        return _bracketed(self.unit)


def curves_of(mismatch: Mismatch) -> ReadingCourses | None:
    """The curves of a comparison; None if there are none."""
    curves, fit = mismatch.curves, mismatch.fit
    if curves is None or not np.isfinite(curves.measured + curves.time).any():
        return None
    order = np.argsort(curves.time, kind="stable")
    order = order[np.isfinite(curves.time[order])]
    repaired = curves.repaired if is_repaired(mismatch) else np.full(len(curves.time), np.nan)
    arrays = {n: v[order] for n, v in vars(curves).items() if isinstance(v, np.ndarray)}
    return ReadingCourses(
        signal=fit.signal if fit is not None else "predicted signal",
        unit=fit.unit if fit is not None else "",
        curves=Curves(
            **{**arrays, "repaired": repaired[order]},
            drivers={title: readings[order] for title, readings in curves.drivers.items()},
        ),
        located=_located(mismatch, curves)[order],
    )


def _located(mismatch: Mismatch, curves: Curves) -> np.ndarray:
    """Points in the region of some location or, if it has none, in its periods."""
    located = np.zeros(len(curves.time), dtype=bool)
    readings = {title.partition(" [")[0]: values for title, values in curves.drivers.items()}
    for location in mismatch.locations:
        read = [r for r in location.region if r.variable in readings]
        inside = np.full(len(located), bool(read))
        for region in read:
            inside &= readings[region.variable] >= (-np.inf if region.low is None else region.low)
            inside &= readings[region.variable] <= (np.inf if region.high is None else region.high)
        for since, until in () if read else location.periods:
            inside |= (curves.time >= since) & (curves.time <= until)
        located |= inside
    return located


def middle_by(driver: Array, values: Array) -> tuple[Array, Array]:
    """Median of values in parts of a driver's range: centres and medians, shape (parts,).

    NaN where there are too few values.
    """
    finite = np.isfinite(driver) & np.isfinite(values)
    x, y = driver[finite], values[finite]
    if not len(x) or x.min() == x.max():
        return np.array([]), np.array([])
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    bin_ = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, BINS - 1)
    parts = [y[bin_ == i] for i in range(BINS)]
    medians = [float(np.median(own)) if len(own) >= FEWEST else np.nan for own in parts]
    return (edges[:-1] + edges[1:]) / 2, np.array(medians)


def _drivers(mismatch: Mismatch, drawn: ReadingCourses) -> tuple[list[str], list[str]]:
    """Titles of drivers of the mismatch, and of all others, by the variation of the error."""
    drivers = drawn.curves.drivers

    def moved(title: str) -> float:
        return span(middle_by(drivers[title], drawn.error("recalibrated"))[1])

    titles = {t.partition(" [")[0]: t for t in sorted(drivers, key=moved, reverse=True)}
    names = [at.shape.driver for at in mismatch.locations if at.shape is not None]
    names += [part.variable for at in mismatch.locations for part in at.region]
    followed = [titles[name] for name in dict.fromkeys(names) if name in titles]
    return followed, [title for title in titles.values() if title not in followed]


def span(values: Array) -> float:
    """Distance from the smallest to the largest known value, shape (n,); 0 if none is known."""
    finite = values[np.isfinite(values)]
    return float(np.ptp(finite)) if len(finite) else 0.0


def pictures_of(mismatch: Mismatch, calendar: Calendar | None = None) -> list[Figure]:
    """All pictures of the comparison, those over the drivers of the mismatch first."""
    drawn = curves_of(mismatch)
    shapes = [(at, s) for at in mismatch.locations if (s := at.shape) and s.driver != TIME]
    figures = [_left_out(location, shape, i) for i, (location, shape) in enumerate(shapes)]
    if drawn is not None:
        followed, others = _drivers(mismatch, drawn)
        errors = [
            _over_driver(drawn, i, title) for i, title in enumerate([*followed, *others][:DRIVERS])
        ]
        first = 1 if followed else 0
        figures += [*errors[:first], over_time(drawn, calendar), *errors[first:]]
    if mismatch.latent_input is not None and np.isfinite(mismatch.latent_input.course).any():
        figures.append(_course(mismatch.latent_input, calendar))
    return figures


def _left_out(location: Location, shape: Shape, index: int) -> Figure:
    """The missing term at a place over its driver: the curve, its band, and single means."""
    at, low, high = shape.at, shape.value - 2.0 * shape.u, shape.value + 2.0 * shape.u
    z, v, u = shape.means.T
    place = f"{location.module}.{location.place}"
    title = f"What is missing at {place} over {shape.driver}"
    below = f"{shape.driver}{_bracketed(shape.driver_unit)}"
    across = axis(float(at[0]), float(at[-1]), 8, tight=True, title=below)
    down = holding(low, high, v, np.zeros(1), title=f"missing in {place}{_bracketed(shape.unit)}")
    panel = Panel(title, across, down, 240)
    panel.band(at, low, high, "s0")
    panel.bars(z, v - 2.0 * u, v + 2.0 * u, "s1")
    panel.curve(at, shape.value, "s0")
    panel.marks(z, v, "disc", "s1")
    key = ["blue: what the law would have to add, with its 95 % band"]
    return Figure(
        name=f"shape{index}",
        title=title,
        key=key + ["orange: means of operating states, with their 95 % bars"] * (len(z) > 0),
        panels=[panel],
        caption=f"Over {shape.driver} {shape.text}. Hysteresis: {hysteresis(shape)}.",
        narrow=True,
    )


def over_time(drawn: ReadingCourses, calendar: Calendar | None) -> Figure:
    """Measured and predicted values, and below them the errors of the models."""
    curves = drawn.curves
    across, title = over(curves.time, calendar), f"{drawn.signal} over time"
    of_values = holding(curves.measured, curves.recalibrated, title=drawn.signal + drawn.in_unit)
    errors = (drawn.error("repaired"), drawn.error("recalibrated"))
    of_errors = holding(*errors, title=f"measured less predicted{drawn.in_unit}")
    upper = Panel(title, across, of_values, 240)
    lower = Panel(f"error of {drawn.signal}", across, of_errors, 130)
    for panel in (upper, lower):
        panel.spans(curves.time, drawn.located, "located")
        panel.spans(curves.time, curves.heldout, "heldout", 0.05)
    for model, _, style in MODELS:
        values = getattr(curves, model)
        upper.course(curves.time, values, style)
        if model != "shipped":
            lower.course(curves.time, curves.measured - values, style)
    upper.course(curves.time, curves.measured, "plain")
    upper.labels([(label, getattr(curves, model), style) for model, label, style in MODELS])
    key = ["thin: measured"]
    key += ["shaded: where the mismatch was located"] if drawn.located.any() else []
    key += ["grey at the foot: held out"] if curves.heldout.any() else []
    return Figure(
        name="time", title=title, key=key, panels=[upper, lower], caption=_say_time(drawn)
    )


def _say_time(drawn: ReadingCourses) -> str:
    def off(flags: np.ndarray) -> str:
        errors = (drawn.error(model)[flags] for model in ("recalibrated", "repaired"))
        before, after = (rms(e[np.isfinite(e)]) for e in errors)
        words = f"the recalibrated model is off by {number(before, 2)}{suffix(drawn.unit)} rms"
        if np.isfinite(after):
            words += f", the repaired one by {number(after, 2)}{suffix(drawn.unit)}"
        return words

    judged = drawn.curves.inside
    inside, outside = drawn.located & judged, judged & ~drawn.located
    if not (inside.any() and outside.any()):
        return f"Over {counted(int(judged.sum()), 'point')} {off(judged)}."
    shaded = percent(float(inside.sum() / judged.sum()))
    return f"In the shaded {shaded} {off(inside)}; outside it {off(outside)}."


def _over_driver(drawn: ReadingCourses, index: int, title: str) -> Figure:
    """Errors over a driver before and after the repair, on one scale."""
    readings = drawn.curves.drivers[title]
    models = MODELS[1:] if np.isfinite(drawn.curves.repaired).any() else MODELS[1:2]
    across = replace(holding(readings), title=title)
    down = holding(*(drawn.error(model) for model, _, _ in models))
    panels, moves = [], []
    for model, _, style in models:
        error = drawn.error(model)
        medians = middle_by(readings, error)
        heading = f"measured less {model}{drawn.in_unit}"
        panel = Panel(f"error of the {model} model", across, replace(down, title=heading), 150)
        panel.cloud(readings, error, style)
        panel.curve(*medians, "plain")
        panels.append(panel)
        if np.isfinite(medians[1]).any():
            moves.append(number(span(medians[1]), 2) + suffix(drawn.unit))
    caption = f"{title} does not vary enough to show anything."
    if moves:
        caption = f"Over {title} the median error spans {moves[0]}"
        caption += f" before the repair and {moves[1]} after it." if moves[1:] else "."
    above = ["above before the repair, below after it"] if len(models) > 1 else []
    return Figure(
        name=f"driver{index}",
        title=f"Error over {title}",
        key=[*above, "line: median"],
        panels=panels,
        caption=caption,
        narrow=True,
    )


def _course(latent: LatentInput, calendar: Calendar | None) -> Figure:
    """Course of the hidden driver, as seen at the place that it affects."""
    name, text = f"{latent.module}.{latent.place}", latent.text.rstrip(".") or "The course"
    down = holding(latent.course, title=f"shift of {name}{_bracketed(latent.unit)}")
    panel = Panel(f"course at {name}", over(latent.time, calendar), down, 170)
    panel.course(latent.time, latent.course, "s0")
    spans = number(span(latent.course), 2) + suffix(latent.unit)
    return Figure(
        name="hidden",
        title="Course of what is not recorded",
        panels=[panel],
        caption=f"{text[:1].upper()}{text[1:]}; it spans {spans}.",
    )


def _bracketed(unit: str) -> str:
    return f" [{unit}]" if unit not in ("", "1") else ""
