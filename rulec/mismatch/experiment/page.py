"""An experiment as one page: what it is worth, its steps, and what each explanation foretells."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.report.chart import SYMBOLS, Axis, Panel, axis
from rulec_runtime.report.document import Head, document, numbered, section
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.html_story import badge
from rulec_runtime.report.made import Made
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.tables import Column, table
from rulec_runtime.report.text import percent, safe

from rulec.mismatch.experiment import limits
from rulec.mismatch.experiment.result import Experiment
from rulec.mismatch.experiment.words import (
    as_read,
    as_set,
    duration,
    headline,
    in_words,
    remarks,
    sure_after,
)

SPREAD = 0.7
"""Width in a picture over which the explanations of a step are spread, in steps."""

FEWEST_SPREAD = 3
"""Explanations from which on they fill that width; fewer stand as near to one another."""


def experiment_page(found: Experiment, ruleset: Ruleset, made: Made | None = None) -> str:
    """The page as HTML; the same experiment gives the same text."""
    standing = _items(
        "ol", (f"{in_words(one)} ({percent(one.probability)})" for one in found.standing)
    )
    sections = [section("What may be true", standing)]
    if found.steps:
        sections.append(section("What to set", _set(found, ruleset)))
        sections.append(section("What is read", _read(found, ruleset)))
        sections.append(section("Pictures", "".join(numbered(_pictures(found, ruleset)))))
    sections.append(section("Remarks", _items("ul", remarks(found, ruleset))))
    head = Head(
        kind="Experiment",
        verdict=headline(found).removesuffix("."),
        badge=badge("M" if found.steps else "C"),
        facts=tuple(Subject(ruleset=ruleset).facts()),
        made=made,
        sketch=sketch(ruleset, _marks(found, ruleset)),
    )
    return document(head, "".join(sections))


def _marks(found: Experiment, ruleset: Ruleset) -> dict[str, str]:
    """Modules about which the explanations differ."""
    named = [name.partition(".")[0] for one in found.standing for name in one.names]
    return {name: "S" for name in named if name in ruleset.modules}


def _items(kind: str, lines: Iterable[str]) -> str:
    return f"<{kind}>{''.join(f'<li>{safe(line)}</li>' for line in lines)}</{kind}>"


def _set(found: Experiment, ruleset: Ruleset) -> str:
    """Per step how long it takes, what to set, and how sure the truth can be after it."""
    slowly = any(step.ramp for step in found.steps)
    ways = {"way": True} if slowly else {}
    ends = {"sure": True} if found.telling else {}
    columns = {"step": True, **ways, "hold": True, "set": False, **ends}
    rows = []
    for place, step in enumerate(found.steps):
        inputs = [
            as_set(ruleset.signal_by_id[name], value)
            for name, value in step.inputs.items()
            if name in found.set_by
        ]
        way = [duration(math.ceil(step.ramp))] if slowly else []
        hold = duration(step.until - step.since - step.ramp)
        sure = [[sure_after(found, place + 1)]] if found.telling else []
        rows.append([[str(place + 1)], *([w] for w in way), [hold], inputs, *sure])
    return _table("what to set", columns, rows)


def _read(found: Experiment, ruleset: Ruleset) -> str:
    """Per step the most telling readings, and what each explanation foretells of them."""
    count = len(found.standing)
    columns = {"step": True, "read": False, **{f"if {i + 1}": True for i in range(count)}}
    rows = []
    for place, step in enumerate(found.steps):
        told = step.readings[: limits.READINGS_TOLD]
        signals = [ruleset.signal_by_id[r.signal] for r in told]
        pairs = list(zip(signals, told, strict=True))
        names = [f"{signal.id} [{signal.unit}]" for signal in signals]
        values = [[as_read(signal, r, i) for signal, r in pairs] for i in range(count)]
        rows.append([[str(place + 1)], names, *values])
    return _table("what is read", columns, rows)


def _table(name: str, of: Mapping[str, bool], rows: Sequence[Sequence[Sequence[str]]]) -> str:
    """Cells of some lines each, below titles of columns that tell whether these are numbers."""
    titles = [Column(title, "num" if numeric else "") for title, numeric in of.items()]
    return table(name, titles, (["<br/>".join(map(safe, lines)) for lines in row] for row in rows))


def _pictures(found: Experiment, ruleset: Ruleset) -> Iterator[Figure]:
    """One per signal that is told in some step."""
    told = [r.signal for s in found.steps for r in s.readings[: limits.READINGS_TOLD]]
    for index, name in enumerate(dict.fromkeys(told)):
        yield _picture(found, ruleset.signal_by_id[name], index)


def _picture(found: Experiment, signal: SignalSpec, index: int) -> Figure:
    """What each explanation foretells of a signal, less what the likeliest does, in each step in
    which it is foretold."""
    told = {
        float(place): reading
        for place, step in enumerate(found.steps, start=1)
        for reading in step.readings
        if reading.signal == signal.id
    }
    readings = list(told.values())
    values = np.array([r.values for r in readings]) / signal.factor
    spread = 2.0 * np.array([r.spread for r in readings]) / abs(signal.factor)
    off = values - values[:, :1]
    count = len(found.standing)
    apart = SPREAD / max(count, FEWEST_SPREAD)
    steps, last = np.array(list(told)), len(found.steps)
    across = Axis(0.5, last + 0.5, tuple(float(place) for place in range(1, last + 1)))
    low, high = float(np.min(off - spread)), float(np.max(off + spread))
    panel = Panel(across, axis(low, high, 5), 240)
    bars, marks = [], []
    for number in range(count):
        x = steps + apart * (number - (count - 1) / 2.0)
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
        narrow=True,
    )
