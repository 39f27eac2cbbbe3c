"""How effort grows, as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any


def draw(curves: Sequence[Mapping[str, Any]], file: Path) -> None:
    """CPU time over counts, both against the first of a curve, on logarithmic axes; as SVG."""
    import matplotlib

    matplotlib.use("svg")
    # The same bytes for the same figures.
    matplotlib.rcParams.update({"svg.hashsalt": "growth", "svg.fonttype": "none"})
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(7.2, 4.2), layout="constrained")
    for curve in curves:
        counts, seconds = curve["counts"], curve["seconds"]
        axes.plot(
            [n / counts[0] for n in counts],
            [s / seconds[0] for s in seconds],
            marker="o",
            label=f"{curve['what'].partition(', ')[0]}: power {curve['exponent']:.2f}",
        )
    largest = max(curve["counts"][-1] / curve["counts"][0] for curve in curves)
    axes.plot([1, largest], [1, largest], "--", color="0.6", label="power 1")
    axes.set(xscale="log", yscale="log", xlabel="times as many", ylabel="times the CPU time")
    axes.legend(fontsize="small")
    figure.savefig(file, metadata={"Date": None})
