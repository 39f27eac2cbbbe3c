"""Draw charts as SVG: axes, bands, curves and marks.

A panel is as wide as the page allows. Curves are in an inner picture that is stretched to the
panel; texts and marks are placed in percent of its width, so they keep their shape and size on
paper and on a phone.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.report.text import number, safe

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


def axis(low: float, high: float, wanted: int = 6, tight: bool = False) -> Axis:
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
    return Axis(low, high, min(scales, key=lambda ticks: abs(len(ticks) - wanted)))


@dataclass(frozen=True)
class Panel:
    """A drawing area: two axes and a height in CSS pixels."""

    x: Axis
    y: Axis
    height: int

    def _x(self, values: Array) -> Array:
        return WIDTH * self.x.share(values)

    def _y(self, values: Array) -> Array:
        # Values far beyond the panel are clipped, since shorter numbers save bytes.
        return np.clip(self.height * (1 - self.y.share(values)), -self.height, 2 * self.height)

    def curve(self, x: Array, y: Array, style: str) -> str:
        """A curve that breaks at NaN; a single value between breaks becomes a dot."""
        parts = []
        for run in runs_of(np.isfinite(x) & np.isfinite(y)):
            points = _joined(self._x(x[run]), self._y(y[run]))
            parts.append(f"M{points}" if "L" in points else f"M{points}h0")
        return f'<path class="curve {style}" d="{"".join(parts)}"/>' if parts else ""

    def band(self, x: Array, low: Array, high: Array, style: str) -> str:
        """The area between two curves."""
        parts = []
        for run in runs_of(np.isfinite(x) & np.isfinite(low) & np.isfinite(high)):
            across = self._x(x[run])
            if len(across) == 1:
                across = across + np.array([-2.0, 2.0])
            upper, lower = (np.broadcast_to(self._y(v[run]), across.shape) for v in (high, low))
            there = np.append(across, across[::-1]), np.append(upper, lower[::-1])
            parts.append(f"M{_joined(*there)}Z")
        return f'<path class="band {style}" d="{"".join(parts)}"/>' if parts else ""

    def spans(self, x: Array, flags: np.ndarray, style: str, top: float = 1.0) -> str:
        """Shade where flags are true, from the bottom up to a share of the height.

        `x`, shape (n,), increases; a flag extends halfway to its neighbours.
        """
        edges = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
        there = np.where(np.repeat(flags, 2), 1.0, np.nan)
        high = self.y.low + top * (self.y.high - self.y.low)
        return self.band(np.repeat(edges, 2)[1:-1], self.y.low * there, high * there, style)

    def marks(self, x: Array, y: Array, symbol: str, style: str) -> str:
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
        body = "".join(uses)
        return f'<g class="mark {style}">{body}</g>' if body else ""

    def bars(self, x: Array, low: Array, high: Array, style: str) -> str:
        """Vertical error bars."""
        across, ends = self._x(x), (self._y(low), self._y(high))
        parts = [f"M{a:.1f} {b:.1f}V{c:.1f}" for a, b, c in zip(across, *ends, strict=True)]
        return f'<path class="curve {style}" d="{"".join(parts)}"/>' if parts else ""

    def text(self, x: float, y: float, words: str, style: str, shift: int = 0) -> str:
        """Words at a point of the panel, shifted down by `shift` pixels."""
        across, down = 100 * float(self.x.share(x)), self.height * (1 - float(self.y.share(y)))
        return (
            f'<text class="{style}" x="{across:.2f}%" y="{down + shift:.1f}">{safe(words)}</text>'
        )

    def beside(self, words: str, more: str, loud: bool) -> str:
        """Words to the right of the panel, at half its height; `more` only on a wide page."""
        style = "note loud" if loud else "note"
        rest = f'<tspan class="more"> {safe(more)}</tspan>' if more else ""
        return (
            f'<text class="{style}" x="100%" dx="8" y="{self.height / 2}">{safe(words)}{rest}'
            "</text>"
        )

    def drawn(
        self, name: str, title: str, stretched: Sequence[str], fixed: Sequence[str], foot: bool
    ) -> str:
        """The panel as SVG.

        Parameters
        ----------
        name : what the picture shows, for screen readers.
        title : of the vertical axis, with its unit.
        stretched : curves, bands and bars.
        fixed : marks and texts.
        foot : whether the horizontal axis has labels.
        """
        return (
            f'<svg class="panel" height="{self.height}" role="img" aria-label="{safe(name)}">'
            f'{"".join(self._grid(foot))}<svg class="data" width="100%" height="{self.height}" '
            f'viewBox="0 0 {WIDTH} {self.height}" preserveAspectRatio="none">'
            f"{''.join(stretched)}</svg>"
            f'<text class="title" x="0" y="-8">{safe(title)}</text>{"".join(fixed)}</svg>'
        )

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


def labels_apart(panel: Panel, ends: Sequence[float | None], words: Sequence[str]) -> str:
    """Names at the right ends of curves, pushed apart where they would overlap.

    `ends` are the last values of the curves, None for an empty one; a label takes the style of its
    curve.
    """
    room = 15.0
    placed = {
        i: panel.height * (1 - float(panel.y.share(v))) for i, v in enumerate(ends) if v is not None
    }
    order = sorted(placed, key=placed.__getitem__)
    above, below = 6.0 - room, panel.height + room
    for i in order:
        above = placed[i] = max(placed[i], above + room)
    for i in reversed(order):
        below = placed[i] = min(placed[i], below - room)
    return "".join(
        f'<text class="name s{i % 6}" x="100%" dx="8" y="{placed[i]:.1f}">{safe(words[i])}</text>'
        for i in order
    )


def _joined(x: Array, y: Array) -> str:
    """Points as a path, without its beginning."""
    return "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def runs_of(sound: np.ndarray) -> Iterator[slice]:
    """Runs of True, as slices."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], sound.astype(int), [0]])))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(start), int(stop))
