"""Figures of a run: share of right names against strength, and errors of repaired models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.report.chart import Axis, Panel, axis
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.text import counted, fixed, number, percent

from rulec.prove.limits import ENOUGH_CASES, MOSTLY
from rulec.prove.results import Judged
from rulec.prove.scores import HALVES, RATIO, Bin, curve, values_of

ROOM = 1.14
"""Top of the scale of shares: the space above 1 shows the counts."""

WIDTHS, BINS = (0.01, 0.02, 0.05), 36
"""Widths of the bins of ratios; the first that needs at most BINS bins is used."""

ENDS = (0.5, 2.0)
"""Ratios outside are counted in the outer bins."""


@dataclass(frozen=True)
class Decades(Axis):
    """A logarithmic scale, labelled with the numbers themselves."""

    def labels(self) -> list[str]:
        return [number(10.0**tick, 15) for tick in self.ticks]


@dataclass(frozen=True)
class Percents(Axis):
    """A scale of shares, labelled in percent."""

    def labels(self) -> list[str]:
        return [percent(tick) for tick in self.ticks]


def draw_curve(judged: Sequence[Judged]) -> Figure | None:
    """Draw right names and places against strength, a panel per half; None without cases."""
    names, places = curve(judged, "name_right"), curve(judged, "place_right")
    halves = [half for half in HALVES if names[half] or places[half]]
    every = [b for half in halves for b in (*names[half], *places[half])]
    if not every:
        return None
    ends = [np.log10([min(b.low for b in every), max(b.high for b in every)])]
    ticks = tuple(float(t) for t in range(int(np.floor(ends[0][0])), int(ends[0][1]) + 1))
    across = Decades(float(ends[0][0]), float(ends[0][1]), ticks)
    parts = []
    for half in halves:
        last = half == halves[-1]
        svg = _panel(across, half, names[half], places[half], last)
        parts.append(plot(svg, last, "strength: gain in log likelihood of the true model"))
    key = "blue: right name, with 95 % interval; orange: right place; numbers: cases"
    return Figure(
        name="curve",
        title="What is named of how strong an effect",
        key=key,
        body="".join(parts),
        caption=_say(names),
    )


def _panel(across: Axis, half: str, names: list[Bin], places: list[Bin], foot: bool) -> str:
    panel = Panel(across, Percents(0.0, ROOM, (0.0, 0.25, 0.5, 0.75, 1.0)), 190)
    drawn, fixed_ = [], []
    for bins, style, symbol in ((places, "s1", "square"), (names, "s0", "disc")):
        x = np.array([np.log10(b.centre) for b in bins])
        y = np.array([b.share for b in bins])
        if symbol == "disc":
            low, high = np.array([b.ends for b in bins]).reshape(-1, 2).T
            drawn.append(panel.band(x, low, high, style))
        drawn.append(panel.curve(x, y, style))
        fixed_.append(panel.marks(x, y, symbol, f"{style} all"))
    fixed_ += [
        panel.text(float(np.log10(b.centre)), ROOM, str(b.count), "value count", 12) for b in names
    ]
    return panel.drawn(f"{half}: share of right answers by strength", half, drawn, fixed_, foot)


def _say(names: dict[str, list[Bin]]) -> str:
    """The strength above which nine of ten are named, per half."""
    sentences = []
    for half, bins in names.items():
        if not bins:
            continue
        above = [bins[i:] for i in range(len(bins))]
        above = [part for part in above if sum(b.count for b in part) >= ENOUGH_CASES] or [bins]
        shares = [sum(b.hits for b in part) / sum(b.count for b in part) for part in above]
        good = [b.low for b, share in zip(bins, shares, strict=False) if share >= MOSTLY]
        sentences.append(
            f"{half}: of effects with a gain above {number(good[0], 2)}, nine of ten are named "
            "rightly"
            if good
            else f"{half}: {percent(shares[0])} are named rightly, and nine of ten at no strength"
        )
    return f"{'; '.join(sentences)}.".capitalize() if sentences else "No effect was to be named."


def draw_ratio(judged: Sequence[Judged]) -> Figure | None:
    """Draw the errors of repairs over those of the true model refitted; None without repairs."""
    ratios = np.array(values_of(judged, "ratio"))
    if not len(ratios):
        return None
    edges = _edges(ratios)
    low, high, width = float(edges[0]), float(edges[-1]), float(edges[1] - edges[0])
    counts, _ = np.histogram(np.clip(ratios, low, high - 1e-9), edges)
    panel = Panel(axis(low, high, 8, tight=True), axis(0.0, float(counts.max()), 4), 190)
    gap = width / 12
    x = np.column_stack([edges[:-1] + gap, edges[1:] - gap, edges[1:]]).ravel()
    y = np.column_stack([counts, counts, np.full(len(counts), np.nan)]).ravel()
    goal = np.full(2, RATIO.high)
    svg = panel.drawn(
        "held-out error over that of the true model",
        "cases",
        [
            panel.band(x, np.zeros(len(x)), y, "s0 solid"),
            panel.curve(goal, np.array([0.0, panel.y.high]), "truth"),
        ],
        [],
        True,
    )
    near = float(np.mean(ratios <= RATIO.high))
    words = (
        f"{percent(near)} of {counted(len(ratios), 'case')} are within the goal; the middle one is "
        f"at {fixed(float(np.median(ratios)), 3)}, the worst at {number(float(ratios.max()))}."
    )
    key = f"dashed: goal; outer bins also hold what is below {low:.3g} and above {high:.3g}"
    body = plot(svg, True, "held-out error over that of the true model refitted")
    return Figure(
        name="ratio", title="How near repairs come to the truth", key=key, body=body, caption=words
    )


def _edges(ratios: np.ndarray) -> np.ndarray:
    """Edges of bins that contain the ratios, 1 and the goal."""
    low = max(min(float(ratios.min()), 0.95), ENDS[0])
    high = min(max(float(ratios.max()), 1.15), ENDS[1])
    width = next((w for w in WIDTHS if (high - low) / w <= BINS), WIDTHS[-1])
    first, last = np.floor(low / width + 1e-9), np.ceil(high / width - 1e-9)
    return width * np.arange(first, last + 1)
