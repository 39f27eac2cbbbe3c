"""An experiment as a recipe: words, a table, and bands of what is read, for the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.console import Console
from rich.table import Table
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.text import percent

from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.result import Experiment, Reading
from rulec.mismatch.experiment.words import (
    as_read,
    as_set,
    duration,
    headline,
    in_words,
    remarks,
    sure_after,
)

BAND = 50
"""Characters across a picture."""


def tell(out: Console, found: Experiment, ruleset: Ruleset) -> None:
    """The finding, the explanations, the steps, and what they leave open."""
    out.print()
    out.print(styled("[bold]{}[/]", headline(found)))
    out.print()
    for place, one in enumerate(found.standing, start=1):
        out.print(styled("  {}  {} ({})", place, in_words(one), percent(one.probability)))
    if found.steps:
        out.print()
        out.print(_table(found, ruleset))
        out.print()
        bands = list(_bands(found, ruleset))
        for line in bands:
            out.print(styled("{}", line))
        if bands:
            out.print()
    for line in remarks(found, ruleset):
        out.print(styled("{}", line))


def _table(found: Experiment, ruleset: Ruleset) -> Table:
    signals = ruleset.signal_by_id
    table = Table(box=None, pad_edge=False, header_style="dim")
    slowly = any(step.ramp for step in found.steps)
    for title in ("step", "time" if slowly else "hold", "set"):
        table.add_column(title)
    table.add_column("read")
    for place in range(1, len(found.standing) + 1):
        table.add_column(f"if {place}", justify="right")
    if found.telling:
        table.add_column("sure", justify="right")
    for place, step in enumerate(found.steps, start=1):
        told = step.readings[: limits.READINGS_TOLD]
        hold = duration(step.until - step.since - step.ramp)
        table.add_row(
            str(place),
            f"way {duration(math.ceil(step.ramp))}\nhold {hold}" if slowly else hold,
            "\n".join(
                as_set(signals[name], value)
                for name, value in step.inputs.items()
                if name in found.set_by
            ),
            "\n".join(f"{r.signal} [{signals[r.signal].unit}]" for r in told),
            *(
                "\n".join(as_read(signals[r.signal], r, i) for r in told)
                for i in range(len(found.standing))
            ),
            *([sure_after(found, place)] if found.telling else ()),
        )
    return table


def _bands(found: Experiment, ruleset: Ruleset) -> Iterator[str]:
    """Of the steps that tell most, the most telling reading under each explanation, with its 95 %
    band."""
    gains = [b - a for a, b in zip(found.certainty, found.certainty[1:], strict=False)]
    best = sorted(range(len(gains)), key=lambda i: -gains[i])[: limits.STEPS_DRAWN]
    for place in sorted(best):
        reading = found.steps[place].readings[0]
        signal = ruleset.signal_by_id[reading.signal]
        low, high = _ends(reading)
        yield (
            f"step {place + 1}: {signal.id} from {signal.shown(low):.4g} to "
            f"{signal.shown(high):.4g} {signal.unit}, with 95 % bands"
        )
        for number, (value, u) in enumerate(
            zip(reading.values, reading.spread, strict=True), start=1
        ):
            left, middle, right = (
                round((BAND - 1) * (v - low) / (high - low))
                for v in (value - 2.0 * u, value, value + 2.0 * u)
            )
            line = [" "] * left + ["─"] * (right - left + 1)
            line[left], line[right], line[middle] = "├", "┤", "●"
            yield f"  if {number}  {''.join(line)}"


def _ends(reading: Reading) -> tuple[float, float]:
    """From the lowest to the highest end of all bands, SI."""
    every = list(zip(reading.values, reading.spread, strict=True))
    return min(v - 2.0 * u for v, u in every), max(v + 2.0 * u for v, u in every)
