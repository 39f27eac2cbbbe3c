"""The figure of a run: share of right names against strength."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from rulec_runtime.report.chart import Axis, Panel
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.text import number, percent

from rulec.prove.limits import ENOUGH_CASES, MOSTLY
from rulec.prove.results import Judged
from rulec.prove.scores import HALVES, Bin, curve

ROOM = 1.14
"""Top of the scale of shares: the space above 1 shows the counts."""


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
