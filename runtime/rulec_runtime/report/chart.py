"""Draw charts as SVG: axes, bands, curves and marks.

A panel is as wide as the page allows. Curves are in an inner picture that is stretched to the
panel; texts and marks are placed in percent of its width, so they keep their shape and size on
paper and on a phone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.report.text import Html, number, safe
from rulec_runtime.report.thin_curves import (
    cells_of,
    is_long,
    thin_band,
    thin_flags,
    thin_series,
)

WIDTH = 1000
"""Width of the inner picture in its own units."""

SYMBOLS = {
    "up": '<path d="M0-5 5 4H-5Z"/>',
    "down": '<path d="M0 5 5-4H-5Z"/>',
    "disc": '<circle r="3.4"/>',
    "square": '<path d="M-3.2-3.2H3.2V3.2H-3.2Z"/>',
    "diamond": '<path d="M0-4.6 4.6 0 0 4.6-4.6 0Z"/>',
    "cross": '<path class="open" d="M-4-4 4 4M-4 4 4-4"/>',
}
"""Shapes of marks, centred on the origin."""

FEW = 4
"""Most ticks that all keep their labels on a narrow page."""

TALL = 2
"""Most panels of a figure that are kept on one sheet of paper."""

DECIMALS = 4
"""Most decimals of a label; smaller numbers are written with a power of ten to save room."""


@dataclass(frozen=True)
class Axis:
    """A linear scale with its ticks; `texts` are their labels if these are not the ticks as
    numbers, `below` second lines of labels, `title` is that of the axis."""

    low: float
    high: float
    ticks: tuple[float, ...]
    texts: tuple[str, ...] = ()
    below: tuple[str, ...] = ()
    title: str = ""

    def share(self, values: Array | float) -> Array:
        """Position of values: 0 at the low end, 1 at the high end."""
        return (np.asarray(values, dtype=float) - self.low) / (self.high - self.low)

    def labels(self) -> list[str]:
        """Labels of the ticks, with as many digits as their distance needs."""
        if self.texts:
            return list(self.texts)
        step = self.ticks[1] - self.ticks[0] if len(self.ticks) > 1 else abs(self.ticks[0]) or 1.0
        decimals = max(0, int(np.ceil(-np.log10(step) - 1e-9)))
        if decimals > DECIMALS:
            return [_powered(t, step) for t in self.ticks]
        return [number(round(t, decimals), 15) for t in self.ticks]


def _powered(tick: float, step: float) -> str:
    """A small number such as 2e−5, with the digits that distinguish ticks at such steps."""
    if abs(tick) < 0.5 * step:
        return "0"
    digits = max(0, int(np.floor(np.log10(abs(tick))) - np.floor(np.log10(step))))
    mantissa, exponent = f"{tick:.{digits}e}".split("e")
    return f"{mantissa}e{int(exponent)}".replace("-", "−")


def axis(low: float, high: float, wanted: int = 6, *, tight: bool = False, title: str = "") -> Axis:
    """An axis over a range with about `wanted` ticks at 1, 2 or 5 times a power of ten.

    A `tight` axis ends where the data end; otherwise it leaves some room.

    >>> axis(0.0, 79.0, 8, tight=True).ticks
    (0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0)
    """
    if not high - low > 1e-9 * max(abs(low), abs(high), 1.0):
        half = 0.5 * max(abs(low) * 0.1, 1e-3)
        low, high = low - half, high + half
    if not tight:
        room = 0.06 * (high - low)
        low, high = (low if low == 0 else low - room), high + room
    power = 10.0 ** np.floor(np.log10((high - low) / max(wanted, 1)))
    steps = [float(m * power) for m in (10, 5, 2, 1, 0.5)]
    scales = []
    for step in steps:
        first, last = int(np.ceil(low / step - 1e-9)), int(np.floor(high / step + 1e-9))
        ticks = tuple(float(round(i * step, 12)) for i in range(first, last + 1))
        scales.append(ticks or ((low + high) / 2,))
    return Axis(low, high, min(scales, key=lambda ticks: abs(len(ticks) - wanted)), title=title)


CUT = 0.2
"""Per cent of the values of a long recording that may lie beyond either end of a panel."""


def holding(*values: Array, ticks: int = 5, title: str = "") -> Axis:
    """An axis that holds all finite values, of any shape; of a long recording all but the extreme
    ones, since transients are much larger than faults."""
    finite = np.concatenate([part[np.isfinite(part)] for part in values])
    if not len(finite):
        return axis(0.0, 1.0, ticks, title=title)
    cut = CUT if is_long(max(values, key=np.size)) else 0.0
    low, high = np.percentile(finite, [cut, 100 - cut])
    return axis(float(low), float(high), ticks, title=title)


@dataclass(frozen=True)
class Panel:
    """A drawing area: what it shows (for screen readers), two axes and a height in CSS pixels.

    What is drawn is added to it. Curves, bands and bars are stretched to its width, marks and texts
    are not.
    """

    name: str
    x: Axis
    y: Axis
    height: int
    _stretched: list[str] = field(default_factory=list)
    _fixed: list[str] = field(default_factory=list)

    def _x(self, values: Array) -> Array:
        return WIDTH * self.x.share(values)

    def _y(self, values: Array) -> Array:
        # Values far beyond the panel are clipped, since shorter numbers save bytes.
        return np.clip(self.height * (1 - self.y.share(values)), -self.height, 2 * self.height)

    def curve(self, x: Array, y: Array, style: str) -> None:
        """A curve that breaks at NaN; a single value between breaks becomes a dot."""
        parts = []
        for run in runs_of(np.isfinite(x) & np.isfinite(y)):
            points = _joined(self._x(x[run]), self._y(y[run]))
            parts.append(f"M{points}" if "L" in points else f"M{points}h0")
        self._path(f"curve {style}", parts)

    def course(self, time: Array, values: Array, style: str) -> None:
        """A curve over time, thinned if it is long; it breaks in pauses too."""
        self.curve(*thin_series(time, values), style)

    def cloud(self, x: Array, y: Array, style: str) -> None:
        """Points that lie apart."""
        chosen = self.apart(x, y)
        apart = np.stack([y[chosen], np.full(len(chosen), np.nan)], axis=1)
        self.curve(np.repeat(x[chosen], 2), apart.ravel(), f"dots {style}")

    def apart(self, x: Array, y: Array) -> np.ndarray:
        """Indices of one point per cell of the panel; the others would lie on top of it."""
        return cells_of(self.x.share(x), self.height * self.y.share(y))

    def band(self, x: Array, low: Array, high: Array, style: str) -> None:
        """The area between two curves."""
        parts = []
        for run in runs_of(np.isfinite(x) & np.isfinite(low) & np.isfinite(high)):
            across = self._x(x[run])
            if len(across) == 1:
                across = across + np.array([-2.0, 2.0])
            upper, lower = (np.broadcast_to(self._y(v[run]), across.shape) for v in (high, low))
            there = np.append(across, across[::-1]), np.append(upper, lower[::-1])
            parts.append(f"M{_joined(*there)}Z")
        self._path(f"band {style}", parts)

    def course_band(self, time: Array, low: Array, high: Array, style: str) -> None:
        """A band over time, thinned if it is long."""
        self.band(*thin_band(time, low, high), style)

    def spans(self, x: Array, flags: np.ndarray, style: str, top: float = 1.0) -> None:
        """Shade where flags are true, from the bottom up to a share of the height.

        `x`, shape (n,), increases; a flag extends halfway to its neighbours.
        """
        x, flags = thin_flags(x, flags)
        edges = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
        there = np.where(np.repeat(flags, 2), 1.0, np.nan)
        high = self.y.low + top * (self.y.high - self.y.low)
        self.band(np.repeat(edges, 2)[1:-1], self.y.low * there, high * there, style)

    def marks(self, x: Array, y: Array, symbol: str, style: str) -> None:
        """Shapes at points; those beyond the panel move to its edge."""
        across = 100 * self.x.share(x)
        down = np.clip(self.height * (1 - self.y.share(y)), 0, self.height)
        # A narrow page shows only every third mark.
        style_of = ("", ' class="odd"', ' class="odd"')
        uses = (
            f'<use href="#{symbol}"{style_of[i % 3]} x="{a:.2f}%" y="{b:.1f}"/>'
            for i, (a, b) in enumerate(zip(across, down, strict=True))
            if np.isfinite(a) and np.isfinite(b)
        )
        if body := "".join(uses):
            self._fixed.append(f'<g class="mark {style}">{body}</g>')

    def bars(self, x: Array, low: Array, high: Array, style: str) -> None:
        """Vertical error bars."""
        across, ends = self._x(x), (self._y(low), self._y(high))
        parts = [f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(across, *ends, strict=True)]
        self._path(f"curve {style}", parts)

    def text(self, x: float, y: float, words: str, style: str, shift: int = 0) -> None:
        """Words at a point of the panel, shifted down by `shift` pixels."""
        across, down = 100 * float(self.x.share(x)), self.height * (1 - float(self.y.share(y)))
        self._fixed.append(
            f'<text class="{style}" x="{across:.2f}%" y="{down + shift:.1f}">{safe(words)}</text>'
        )

    def beside(self, words: str, more: str, loud: bool) -> None:
        """Words to the right of the panel, at half its height; `more` only on a wide page."""
        style = "note loud" if loud else "note"
        rest = f'<tspan class="more"> {safe(more)}</tspan>' if more else ""
        self._fixed.append(
            f'<text class="{style}" x="100%" dx="8" y="{self.height / 2}">{safe(words)}{rest}'
            "</text>"
        )

    def labels(self, curves: Sequence[tuple[str, Array, str]]) -> None:
        """Names at the right ends of curves, pushed apart where they would overlap; per curve the
        name, its values, shape (n,), and its style."""
        room = 15.0
        drawn = [(n, v[np.isfinite(v)], s) for n, v, s in curves if np.isfinite(v).any()]
        ends = (float(np.clip(self.y.share(v[-1]), 0.0, 1.0)) for _, v, _ in drawn)
        heights = [self.height * (1 - end) for end in ends]
        order = sorted(range(len(drawn)), key=heights.__getitem__)
        above, below = 6.0 - room, self.height + room
        for i in order:
            above = heights[i] = max(heights[i], above + room)
        for i in reversed(order):
            below = heights[i] = min(heights[i], below - room)
        self._fixed.extend(
            f'<text class="name {drawn[i][2]}" x="100%" dx="8" y="{heights[i]:.1f}">'
            f"{safe(drawn[i][0])}</text>"
            for i in order
        )

    def svg(self, foot: bool = True) -> str:
        """The panel as SVG, in a frame with room for its axes; with a `foot` the horizontal axis
        has labels and its title, further down if labels have two lines."""
        below = f'<div class="below">{safe(self.x.title)}</div>' if foot else ""
        return (
            f'<div class="plot{" deep" * bool(self.x.below)}">'
            f'<svg class="panel" height="{self.height}" role="img" aria-label="{safe(self.name)}">'
            f'{"".join(self._grid(foot))}<svg class="data" width="100%" height="{self.height}" '
            f'viewBox="0 0 {WIDTH} {self.height}" preserveAspectRatio="none">'
            f"{''.join(self._stretched)}</svg>"
            f'<text class="title" x="0" y="-8">{safe(self.y.title)}</text>'
            f"{''.join(self._fixed)}</svg>{below}</div>"
        )

    def _path(self, style: str, parts: Sequence[str]) -> None:
        if parts:
            self._stretched.append(f'<path class="{style}" d="{"".join(parts)}"/>')

    def _grid(self, foot: bool) -> Iterator[str]:
        for value, label in zip(self.y.ticks, self.y.labels(), strict=True):
            y = self.height * (1 - float(self.y.share(value)))
            zero = " zero" if value == 0 else ""
            yield f'<line class="grid{zero}" x2="100%" y1="{y:.1f}" y2="{y:.1f}"/>'
            yield f'<text class="tick y" x="-8" y="{y:.1f}">{label}</text>'
        below, many = self.x.below, len(self.x.ticks) > FEW
        for i, (value, label) in enumerate(zip(self.x.ticks, self.x.labels(), strict=True)):
            x = 100 * float(self.x.share(value))
            yield f'<line class="grid" x1="{x:.2f}%" x2="{x:.2f}%" y2="{self.height}"/>'
            if foot:
                style = "tick x odd" if i % 2 and many else "tick x"
                yield f'<text class="{style}" x="{x:.2f}%" y="{self.height + 16}">{label}</text>'
            if foot and below and below[i]:
                yield f'<text class="{style}" x="{x:.2f}%" y="{self.height + 30}">{below[i]}</text>'


@dataclass(frozen=True, kw_only=True)
class Figure:
    """Panels below each other with a title, the `key` to reading them, and the caption."""

    name: str
    title: str
    key: Sequence[str] = ()
    panels: Sequence[Panel]
    caption: str
    narrow: bool = False


def figures_html(figures: Sequence[Figure]) -> Html:
    """Figures as HTML, with their numbers."""
    parts = []
    for i, figure in enumerate(figures, 1):
        panels = figure.panels
        style = " ".join(["narrow"] * figure.narrow + ["tall"] * (len(panels) > TALL))
        key = f'<p class="key">{safe("; ".join(figure.key))}</p>' if figure.key else ""
        parts.append(
            f'<figure id="{figure.name}" class="{style}"><h3>{safe(figure.title)}</h3>{key}'
            f"{''.join(panel.svg(panel is panels[-1]) for panel in panels)}<figcaption>"
            f"<b>Figure {i}.</b> {safe(figure.caption)}</figcaption></figure>\n"
        )
    return Html("".join(parts))


def _joined(x: Array, y: Array) -> str:
    """Points as a path, without its beginning."""
    return "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def runs_of(sound: np.ndarray) -> Iterator[slice]:
    """Runs of True, as slices."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], sound.astype(int), [0]])))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(start), int(stop))
