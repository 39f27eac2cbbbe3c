"""An experiment as one page: what it is worth, its steps, and what each explanation foretells."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.report.chart import SYMBOLS, Axis, Panel, axis
from rulec_runtime.report.document import document, facts, numbered, section
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.text import percent, safe

from rulec.mismatch import limits
from rulec.mismatch.experiment.result import Experiment, Step
from rulec.mismatch.experiment.words import as_read, as_set, duration, headline, in_words, remarks

APART = 0.12
"""Distance of explanations in a picture, in steps."""


def experiment_page(found: Experiment, ruleset: Ruleset) -> str:
    """The page as HTML; the same experiment gives the same text."""
    standing = facts(
        (f"{place}", [f"{in_words(one)} ({percent(one.probability)})"])
        for place, one in enumerate(found.standing, start=1)
    )
    first = f'<p>{safe(headline(found))}</p><div class="facts">{standing}</div>'
    sections = [section("What can be told apart", first)]
    if found.steps:
        sections.append(section("Steps", _table(found, ruleset)))
        sections.append(section("Pictures", "".join(numbered(_pictures(found, ruleset)))))
    told = "".join(f"<p>{safe(line)}</p>" for line in remarks(found, ruleset))
    sections.append(section("Remarks", told))
    return document(ruleset.title, "the next experiment", "experiment", "".join(sections))


def _table(found: Experiment, ruleset: Ruleset) -> str:
    signals = ruleset.signal_by_id
    count = len(found.standing)
    titles = ["step", "way", "hold", "set", "read", *(f"if {i + 1}" for i in range(count)), "sure"]
    numeric = ["step", "way", "hold", *titles[5:]]
    head = "".join(
        f'<th class="num">{title}</th>' if title in numeric else f"<th>{title}</th>"
        for title in titles
    )
    body = "".join(
        "<tr>"
        + "".join(
            f'<td class="num">{cell}</td>' if title in numeric else f"<td>{cell}</td>"
            for title, cell in zip(titles, _cells(found, place, step, signals), strict=True)
        )
        + "</tr>"
        for place, step in enumerate(found.steps)
    )
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _cells(
    found: Experiment, place: int, step: Step, signals: Mapping[str, SignalSpec]
) -> Iterator[str]:
    told = step.readings[: limits.READINGS_TOLD]
    inputs = [as_set(signals[n], v) for n, v in step.inputs.items() if n in found.set_by]
    yield str(place + 1)
    yield safe(duration(math.ceil(step.ramp)))
    yield safe(duration(step.until - step.since - step.ramp))
    yield "<br/>".join(map(safe, inputs))
    yield "<br/>".join(safe(f"{r.signal} [{signals[r.signal].unit}]") for r in told)
    for number in range(len(found.standing)):
        yield "<br/>".join(safe(as_read(signals[r.signal], r, number)) for r in told)
    yield percent(found.certainty[place + 1])


def _pictures(found: Experiment, ruleset: Ruleset) -> Iterator[Figure]:
    """One per signal that is told in some step."""
    told = [r.signal for s in found.steps for r in s.readings[: limits.READINGS_TOLD]]
    for index, name in enumerate(dict.fromkeys(told)):
        yield _picture(found, ruleset.signal_by_id[name], index)


def _picture(found: Experiment, signal: SignalSpec, index: int) -> Figure:
    """What each explanation foretells of a signal, less what the likeliest does, step by step."""
    readings = [next(r for r in s.readings if r.signal == signal.id) for s in found.steps]
    values = np.array([r.values for r in readings]) / signal.factor
    spread = 2.0 * np.array([r.spread for r in readings]) / abs(signal.factor)
    off = values - values[:, :1]
    count = len(found.standing)
    steps = np.arange(1.0, len(readings) + 1.0)
    across = Axis(0.5, len(readings) + 0.5, tuple(steps.tolist()))
    low, high = float(np.min(off - spread)), float(np.max(off + spread))
    panel = Panel(across, axis(low, high, 5), 240)
    bars, marks = [], []
    for number in range(count):
        x = steps + APART * (number - (count - 1) / 2.0)
        style, shape = f"s{number % 6}", list(SYMBOLS)[number % len(SYMBOLS)]
        bars.append(panel.bars(x, (off - spread)[:, number], (off + spread)[:, number], style))
        marks.append(panel.marks(x, off[:, number], shape, style))
        marks += [
            panel.text(float(a), float(b), str(number + 1), "tick x", -6)
            for a, b in zip(x, (off + spread)[:, number], strict=True)
        ]
    title = f"{signal.id} as each explanation foretells it"
    axis_title = f"{signal.id} less what 1 foretells [{signal.unit}]"
    return Figure(
        name=f"step{index}",
        title=title,
        key="numbers: explanations; bars: 95 % bands, with noise and the doubt of all values",
        body=plot(panel.drawn(title, axis_title, bars, marks, True), True, "step"),
        caption=f"What {signal.id} reads in each step tells which explanation is true. A band has "
        "all that an explanation leaves open; much of that is the same in all steps, so these tell "
        "more together than one by one.",
    )
