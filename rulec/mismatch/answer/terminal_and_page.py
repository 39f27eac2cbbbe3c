"""The story on the terminal and as a page, which also has pictures."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text
from rulec_runtime.contract.plan import Array
from rulec_runtime.output.terminal import one_line, styled
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.report.chart import Axis, Panel, axis, labels_apart
from rulec_runtime.report.document import Head, document, facts, numbered, section
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.html_findings import badge
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.tables import columns, table
from rulec_runtime.report.text import counted, number, percent, safe
from rulec_runtime.report.thin_curves import COLUMNS, extremes, thin_series
from rulec_runtime.report.time_axis import over, time_plot
from rulec_runtime.report.wording import STATUS

from rulec.effects.candidate import TIME
from rulec.mismatch.answer.story import Part, story
from rulec.mismatch.answer.wording import hysteresis, is_repaired, letter, meaning, suffix
from rulec.mismatch.inference.heldout_errors import rms
from rulec.mismatch.result import Curves, HiddenDriver, Location, Mismatch, Shape

# Pictures of a comparison: over time, over drivers, and courses that were not recorded.
#
# The sentence below each is computed from what is drawn.

BINS = 24
"""Parts of a driver's range, each with its own median."""

FEWEST = 3
"""Points that a median needs."""

DRIVERS = 4
"""Most drivers drawn."""

CELLS = (160, 60)
"""Cells of a scatter plot, horizontal and vertical; one point per cell."""

CLIPPED = 0.2
"""Per cent of many points that may lie beyond either end of a panel."""

MODELS = (("shipped", "s5"), ("recalibrated", "s1"), ("repaired", "s0"))
"""Curves and their styles; the number of a style is that of its label."""


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
        known = [r for r in location.region if r.variable in readings]
        inside = np.full(len(located), bool(known))
        for region in known:
            inside &= readings[region.variable] >= (-np.inf if region.low is None else region.low)
            inside &= readings[region.variable] <= (np.inf if region.high is None else region.high)
        for since, until in () if known else location.periods:
            inside |= (curves.time >= since) & (curves.time <= until)
        located |= inside
    return located


def middle_by(driver: Array, values: Array) -> tuple[Array, Array]:
    """Median of values in parts of a driver's range: centres and medians, shape (parts,).

    NaN where there are too few values.
    """
    known = np.isfinite(driver) & np.isfinite(values)
    x, y = driver[known], values[known]
    if not len(x) or x.min() == x.max():
        return np.array([]), np.array([])
    edges = np.linspace(x.min(), x.max(), BINS + 1)
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, BINS - 1)
    parts = [y[place == i] for i in range(BINS)]
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
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if len(known) else 0.0


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
    if mismatch.hidden is not None and np.isfinite(mismatch.hidden.course).any():
        figures.append(_course(mismatch.hidden, calendar))
    return figures


def _left_out(location: Location, shape: Shape, index: int) -> Figure:
    """The missing term at a place over its driver: the curve, its band, and single means."""
    at, low, high = shape.at, shape.value - 2.0 * shape.u, shape.value + 2.0 * shape.u
    z, v, u = shape.means.T
    across = axis(float(at[0]), float(at[-1]), 8, tight=True)
    panel = Panel(across, _holding(low, high, v, np.zeros(1)), 240)
    lines = [
        panel.band(at, low, high, "s0"),
        panel.bars(z, v - 2.0 * u, v + 2.0 * u, "s1"),
        panel.curve(at, shape.value, "s0"),
    ]
    means = "; orange: means of operating states, with their 95 % bars" if len(z) else ""
    place = f"{location.module}.{location.place}"
    title = f"What is missing at {place} over {shape.driver}"
    marks = [panel.marks(z, v, "disc", "s1")]
    svg = panel.drawn(title, f"missing in {place}{_bracketed(shape.unit)}", lines, marks, True)
    return Figure(
        name=f"shape{index}",
        title=title,
        key=f"blue: what the law would have to add, with its 95 % band{means}",
        body=plot(svg, True, f"{shape.driver}{_bracketed(shape.driver_unit)}"),
        caption=f"Over {shape.driver} {shape.text}. Hysteresis: {hysteresis(shape)}.",
        narrow=True,
    )


def over_time(drawn: ReadingCourses, calendar: Calendar | None) -> Figure:
    """Measured and predicted values, and below them the errors of the models."""
    curves = drawn.curves
    across = over(curves.time, calendar)
    upper = Panel(across, _holding(curves.measured, curves.recalibrated), 240)
    lower = Panel(across, _holding(drawn.error("repaired"), drawn.error("recalibrated")), 130)
    above, below = _shades(drawn, upper), _shades(drawn, lower)
    ends: list[float | None] = [None] * 6
    for model, style in MODELS:
        values = getattr(curves, model)
        above.append(upper.curve(*thin_series(curves.time, values), style))
        if np.isfinite(values).any():
            last = values[np.isfinite(values)][-1]
            ends[int(style[1:])] = float(np.clip(last, upper.y.low, upper.y.high))
        if model != "shipped":
            below.append(lower.curve(*thin_series(curves.time, curves.measured - values), style))
    above.append(upper.curve(*thin_series(curves.time, curves.measured), "plain"))
    names = labels_apart(upper, ends, ["repaired", "recalibrated", "", "", "", "as shipped"])
    title, error = f"{drawn.signal} over time", f"error of {drawn.signal}"
    plots = [
        upper.drawn(title, f"{drawn.signal}{drawn.in_unit}", above, [names], False),
        lower.drawn(error, f"measured less predicted{drawn.in_unit}", below, [], True),
    ]
    key = ["thin: measured"]
    key += ["shaded: where the mismatch was located"] if drawn.located.any() else []
    key += ["grey at the foot: held out"] if curves.heldout.any() else []
    return Figure(
        name="time",
        title=title,
        key="; ".join(key),
        body="".join(time_plot(svg, i == 1, across) for i, svg in enumerate(plots)),
        caption=_say_time(drawn),
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


def _shades(drawn: ReadingCourses, panel: Panel) -> list[str]:
    time, flags = drawn.curves.time, [drawn.located, drawn.curves.heldout]
    if len(time) > 2 * COLUMNS:
        columns = [extremes(time, *[flag.astype(float)] * 2) for flag in flags]
        time, flags = columns[0][0], [highest > 0 for _, _, highest in columns]
    return [panel.spans(time, flags[0], "located"), panel.spans(time, flags[1], "heldout", 0.05)]


def _over_driver(drawn: ReadingCourses, index: int, title: str) -> Figure:
    """Errors over a driver before and after the repair, on one scale."""
    readings = drawn.curves.drivers[title]
    models = list(MODELS[1:] if np.isfinite(drawn.curves.repaired).any() else MODELS[1:2])
    across = _holding(readings)
    down = _holding(*(drawn.error(model) for model, _ in models))
    parts, moves = [], []
    for model, style in models:
        panel, last, error = Panel(across, down, 150), model == models[-1][0], drawn.error(model)
        medians = middle_by(readings, error)
        cloud = panel.curve(*_cloud(panel, readings, error), f"dots {style}")
        lines = [cloud, panel.curve(*medians, "plain")]
        heading = f"measured less {model}{drawn.in_unit}"
        svg = panel.drawn(f"error of the {model} model", heading, lines, [], last)
        parts.append(plot(svg, last, title))
        if np.isfinite(medians[1]).any():
            moves.append(number(span(medians[1]), 2) + suffix(drawn.unit))
    caption = f"{title} does not vary enough to show anything."
    if moves:
        caption = f"Over {title} the median error spans {moves[0]}"
        caption += f" before the repair and {moves[1]} after it." if moves[1:] else "."
    above = "above before the repair, below after it; " if len(models) > 1 else ""
    return Figure(
        name=f"driver{index}",
        title=f"Error over {title}",
        key=f"{above}line: median",
        body="".join(parts),
        caption=caption,
        narrow=True,
    )


def _course(hidden: HiddenDriver, calendar: Calendar | None) -> Figure:
    """Course of the hidden driver, as seen at the place that it affects."""
    across = over(hidden.time, calendar)
    panel = Panel(across, _holding(hidden.course), 170)
    line = panel.curve(*thin_series(hidden.time, hidden.course), "s0")
    name, text = f"{hidden.module}.{hidden.place}", hidden.text.rstrip(".") or "The course"
    heading = f"shift of {name}{_bracketed(hidden.unit)}"
    svg = panel.drawn(f"course at {name}", heading, [line], [], True)
    spans = number(span(hidden.course), 2) + suffix(hidden.unit)
    return Figure(
        name="hidden",
        title="Course of what is not recorded",
        key="",
        body=time_plot(svg, True, across),
        caption=f"{text[:1].upper()}{text[1:]}; it spans {spans}.",
    )


def _cloud(panel: Panel, x: Array, y: Array) -> tuple[Array, Array]:
    """Distinct points, one per cell of the panel; NaN between them."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    across, down = panel.x.share(x[known]) * CELLS[0], panel.y.share(y[known]) * CELLS[1]
    _, first = np.unique(np.floor(np.stack([across, down])), axis=1, return_index=True)
    chosen = known[np.sort(first)]
    return np.repeat(x[chosen], 2), np.stack([y[chosen], np.full(len(chosen), np.nan)], 1).ravel()


def _holding(*values: Array) -> Axis:
    """An axis that holds values; of many values, all but the extreme ones."""
    known = np.concatenate(values)
    known = known[np.isfinite(known)]
    if not len(known):
        return axis(0.0, 1.0, 5)
    cut = CLIPPED if len(known) > 2 * COLUMNS else 0.0
    return axis(float(np.percentile(known, cut)), float(np.percentile(known, 100 - cut)), 5)


def _bracketed(unit: str) -> str:
    return f" [{unit}]" if unit not in ("", "1") else ""


_COLOURS = {"F": "red", "C": "dark_orange", "S": "yellow", "M": "blue", "ok": "green"}


def tell(out: Console, mismatch: Mismatch) -> None:
    """Print the story in brief."""
    colour, symbol = _COLOURS[letter(mismatch)], STATUS[letter(mismatch)][0]
    out.print(styled("\n[bold {}]{} {}[/]", colour, symbol, meaning(mismatch)))
    out.print(styled("[dim]{}, {}[/]", mismatch.title, mismatch.recording))
    if mismatch.headline:
        out.print(styled("\n[bold]{}[/]", mismatch.headline))
    for part in story(mismatch, brief=True):
        out.print(styled("\n[bold]{}[/]", part.title))
        for content in _contents(part):
            out.print(Padding(content, (0, 0, 0, 2)))


def _contents(part: Part) -> Iterator[RenderableType]:
    """The table, the sentences and the facts of a part."""
    if part.rows:
        shown = Table(box=None, padding=(0, 1), pad_edge=False, header_style="dim")
        for place, title in enumerate(part.titles):
            justify = "right" if title.startswith(".") else "left"
            shown.add_column(title.removeprefix("."), justify=justify, no_wrap=place > 0)  # type: ignore[arg-type]
        for row in part.rows:
            shown.add_row(*map(one_line, row))
        yield shown
    yield from map(Text, part.texts)
    if part.facts:
        shown = Table(box=None, show_header=False, padding=(0, 1), pad_edge=False)
        shown.add_column(style="dim", min_width=9, no_wrap=True)
        shown.add_column(overflow="fold")
        for term, lines in part.facts:
            for place, line in enumerate(lines):
                shown.add_row(one_line("" if place else term), one_line(line))
        yield shown


def report(mismatch: Mismatch, subject: Subject, made: Made | None = None) -> str:
    """The page as HTML; the same comparison gives the same text.

    Parameters
    ----------
    subject : the plant as its file says, and the recording.
    made : when and by what it was made; None leaves that out.
    """
    style, parts = letter(mismatch), story(mismatch, brief=False)
    sections = [
        f'<section class="finding is-{style}"><h3>{safe(part.title)}</h3>{_html(part)}</section>'
        for part in parts
        if part.first
    ]
    if figures := "".join(numbered(pictures_of(mismatch, subject.calendar))):
        sections.append(section("Pictures", figures))
    sections += [section(safe(part.title), _html(part)) for part in parts if not part.first]
    first, more = verdict(mismatch)
    found = [name for f in mismatch.findings for name in (f.module, *f.members)]
    found += [place.module for place in mismatch.locations]
    head = Head(
        kind="Mismatch of simulation and recording",
        verdict=first,
        meaning=more,
        badge=badge(style),
        facts=tuple(subject.facts()),
        made=made,
        sketch=sketch(subject.ruleset, dict.fromkeys(found, style)),
    )
    return document(head, "".join(sections))


def _html(part: Part) -> str:
    rows = [list(map(safe, row)) for row in part.rows]
    shown = table(part.title, columns(*part.titles), rows) if rows else ""
    texts = "".join(f"<p>{safe(text)}</p>" for text in part.texts)
    more = facts(part.facts) if part.facts else ""
    return shown + texts + (more if part.first or not more else f'<div class="facts">{more}</div>')


def verdict(mismatch: Mismatch) -> tuple[str, str]:
    """The verdict in one sentence, and what must follow at once."""
    text = mismatch.headline or meaning(mismatch)
    first, *rest = re.split(r"(?<=[.])\s+(?=[A-Z])", text, maxsplit=1)
    return first.removesuffix("."), " ".join([*rest, f"{meaning(mismatch)}."])
