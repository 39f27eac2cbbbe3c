"""An experiment as a recipe: the same table and words on the terminal and on a page."""

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

import numpy as np
from rich.console import Console
from rich.table import Table
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.chart import SYMBOLS, Axis, Panel, axis
from rulec_runtime.report.document import Head, document, numbered, section
from rulec_runtime.report.figure import Figure, plot
from rulec_runtime.report.html_findings import badge
from rulec_runtime.report.page_origin import Made
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.tables import columns, table
from rulec_runtime.report.text import fixed, listed, number, percent, safe

from rulec.mismatch import limits
from rulec.mismatch.experiment.result import Experiment, Reading, alike, duration, in_words

READINGS = 2
"""Readings listed for each step."""


def tell(out: Console, found: Experiment, ruleset: Ruleset) -> None:
    """Print the result, the explanations, the steps, and remarks."""
    out.print(styled("\n[bold]{}[/]\n", found.headline))
    for place, line in enumerate(_standing(found), start=1):
        out.print(styled("  {}  {}", place, line))
    if found.steps:
        titles, rows = _steps(found, ruleset)
        shown = Table(box=None, pad_edge=False, header_style="dim")
        for title in titles:
            justify = "right" if title.startswith(".") else "left"
            whole = title in ("step", "time", "hold") or title.startswith(".")
            shown.add_column(title.removeprefix("."), justify=justify, no_wrap=whole)  # type: ignore[arg-type]
        for row in rows:
            # One row per line, so that values stay beside their readings where a cell wraps.
            for lines in zip_longest(*row, fillvalue=""):
                shown.add_row(*lines)
        out.print("", shown, "", sep="\n")
    for line in remarks(found, ruleset):
        out.print(styled("{}", line))


def experiment_page(found: Experiment, ruleset: Ruleset, made: Made | None = None) -> str:
    """The page as HTML; the same experiment gives the same text."""
    sections = [section("What may be true", _items("ol", _standing(found)))]
    if found.steps:
        titles, rows = _steps(found, ruleset)
        cells = (["<br/>".join(map(safe, lines)) for lines in row] for row in rows)
        sections.append(section("Steps", table("steps", columns(*titles), cells)))
        listed = dict.fromkeys(r.signal for s in found.steps for r in s.readings[:READINGS])
        signals = (ruleset.signal_by_id[name] for name in listed)
        figures = [_picture(found, signal, i) for i, signal in enumerate(signals)]
        sections.append(section("Pictures", "".join(numbered(figures))))
    sections.append(section("Remarks", _items("ul", remarks(found, ruleset))))
    named = [name.partition(".")[0] for one in found.standing for name in one.names]
    head = Head(
        kind="Experiment",
        verdict=found.headline.removesuffix("."),
        badge=badge("M" if found.steps else "C"),
        facts=tuple(Subject(ruleset=ruleset).facts()),
        made=made,
        sketch=sketch(ruleset, {name: "S" for name in named if name in ruleset.modules}),
    )
    return document(head, "".join(sections))


def _items(kind: str, lines: Iterable[str]) -> str:
    return f"<{kind}>{''.join(f'<li>{safe(line)}</li>' for line in lines)}</{kind}>"


def _standing(found: Experiment) -> Iterator[str]:
    return (f"{in_words(one)} ({percent(one.probability)})" for one in found.standing)


def _steps(found: Experiment, ruleset: Ruleset) -> tuple[list[str], list[list[list[str]]]]:
    """Titles of columns, with a point before those of numbers, and per step the lines of each
    cell."""
    signals, every = ruleset.signal_by_id, range(len(found.standing))
    slowly = any(step.ramp for step in found.steps)
    titles = ["step", "time" if slowly else "hold", "set", "read"]
    titles += [f".if {own + 1}" for own in every] + [".sure"] * bool(found.telling)
    rows = []
    for place, step in enumerate(found.steps, start=1):
        readings = [(signals[r.signal], r) for r in step.readings[:READINGS]]
        inputs = [(signals[n], v) for n, v in step.inputs.items() if n in found.set_by]
        hold = duration(step.until - step.since - step.ramp)
        cells = [
            [str(place)],
            [f"way {duration(math.ceil(step.ramp))}", f"hold {hold}"] if slowly else [hold],
            [f"{signal.id} {number(signal.shown(v))}\u00a0{signal.unit}" for signal, v in inputs],
            [f"{signal.id} [{signal.unit}]" for signal, _ in readings],
            *([_read(signal, r, own) for signal, r in readings] for own in every),
        ]
        if found.telling:
            cells.append(["" if step.covers else percent(found.certainty[place])])
        rows.append(cells)
    return titles, rows


def _read(signal: SignalSpec, reading: Reading, explanation: int) -> str:
    """The reading if one explanation is true, to enough digits to tell it from the others."""
    value = reading.values[explanation]
    apart = max(reading.values) - min(reading.values)
    noise = apart / reading.apart if reading.apart > 0.0 else reading.spread[explanation]
    digits = math.ceil(math.log10(max(abs(value) / max(noise, 1e-300), 1.0))) + 1
    shown = signal.shown(value)
    size = math.floor(math.log10(abs(shown))) if shown else 0
    return fixed(shown, max(min(max(digits, 3), 7) - 1 - size, 0))


def remarks(found: Experiment, ruleset: Ruleset) -> Iterator[str]:
    """The meaning of the probabilities, what remains open, and which limits are active."""
    if found.telling:
        none = f" The chance that none of these is true ({percent(found.unlisted)}) is counted "
        yield (
            "Sure: the expected probability of the true explanation after the step."
            f"{none + 'against it.' if found.unlisted >= limits.PLAUSIBLE else ''} It assumes the "
            "probabilities above; if they understate the truth, the gain is smaller."
        )
    covers = [i for i, step in enumerate(found.steps, start=1) if step.covers]
    if covers and len(found.standing) > 1:
        yield (
            f"{_steps_of(covers).capitalize()} {'covers' if len(covers) == 1 else 'cover'} the "
            "permitted range, in case none of these explanations is true. No probability is "
            "predicted for them."
        )
    for pair in alike(found.factors):
        if found.telling:
            yield f"No set points within these ranges separate {pair[0] + 1} from {pair[1] + 1}."
        yield _sensor(found, pair)
    signals, ranges = ruleset.signal_by_id, []
    for name, bounds in found.set_by.items():
        low, high = sorted(map(signals[name].shown, bounds))
        ranges.append(f"{name} {number(low)} to {number(high)} {signals[name].unit}")
    within = "the limits" if found.limited else "what was recorded"
    yield f"Set points were chosen within {within}: {', '.join(ranges)}."
    if found.steps and not found.limited:
        yield "Rates of change are unknown: state them in a file of limits (--limits)."
    for one in found.left_out:
        yield (
            f"{in_words(one)} ({percent(one.probability)}) also remains possible. Its effect at "
            "other set points is unknown, so nothing is predicted for it."
        )
    steps: dict[str, list[int]] = {}
    for place, step in enumerate(found.telling if found.limited else (), start=1):
        costs = [f"Product is lost in {{}} (by {' and '.join(step.costs)})."] if step.costs else []
        binds = [f"{n} is at its {end} permitted value in {{}}." for n, end in step.at_end]
        for text in (*costs, *binds):
            steps.setdefault(text, []).append(place)
    yield from (text.format(_steps_of(places)) for text, places in steps.items())
    for name in found.hindering:
        yield f"The limits of {name} forbid steps that would gain more."
    if found.time_is_short:
        yield "There is no time for steps that would gain more: --hours ends the experiment."
    for name in found.unwatched:
        yield f"No explanation predicts {name}, which has limits: watch it while you run this."


def _sensor(found: Experiment, pair: tuple[int, int]) -> str:
    which = f"{pair[0] + 1} from {pair[1] + 1}"
    advised = next((one for one in found.sensors if one.pair == pair), None)
    if advised is None:
        return (
            f"A second reading of any signal, or a flow meter, would not separate {which} either."
        )
    sensor, (first, second) = advised.sensor, advised.values
    cost = f" (relative cost {number(sensor.cost)})" if sensor.cost else ""
    return (
        f"To separate {which}, add {sensor.title}{cost}: the two differ there by "
        f"{number(abs((first - second) / sensor.factor))} {sensor.unit}, and the sensor resolves "
        f"{number(advised.u / sensor.factor)} {sensor.unit}."
    )


def _steps_of(places: Sequence[int]) -> str:
    if len(places) > 2 and places[-1] - places[0] == len(places) - 1:
        return f"steps {places[0]} to {places[-1]}"
    return f"step{'s' * (len(places) > 1)} {listed([str(place) for place in places])}"


SPREAD = 0.7
"""Width in a picture over which three or more explanations of a step are spread, in steps; two are
as near to each other as three."""


def _picture(found: Experiment, signal: SignalSpec, index: int) -> Figure:
    """Predictions of a signal relative to the most probable explanation, per step."""
    predicted = {
        float(place): reading
        for place, step in enumerate(found.steps, start=1)
        for reading in step.readings
        if reading.signal == signal.id
    }
    values = np.array([r.values for r in predicted.values()]) / signal.factor
    spread = 2.0 * np.array([r.spread for r in predicted.values()]) / abs(signal.factor)
    off = values - values[:, :1]
    count, steps, last = len(found.standing), np.array(list(predicted)), len(found.steps)
    across = Axis(0.5, last + 0.5, tuple(float(place) for place in range(1, last + 1)))
    panel = Panel(across, axis(float(np.min(off - spread)), float(np.max(off + spread)), 5), 240)
    bars, marks = [], []
    for own in range(count):
        x = steps + SPREAD / max(count, 3) * (own - (count - 1) / 2.0)
        style, shape = f"s{own % 6}", list(SYMBOLS)[own % len(SYMBOLS)]
        low, high = (off - spread)[:, own], (off + spread)[:, own]
        bars.append(panel.bars(x, low, high, style))
        marks.append(panel.marks(x, off[:, own], shape, style))
        marks += [
            panel.text(float(a), float(b), str(own + 1), "tick x", -6)
            for a, b in zip(x, high, strict=True)
        ]
    title = f"{signal.id} as each explanation predicts it"
    axis_title = f"{signal.id} less the prediction of 1 [{signal.unit}]"
    return Figure(
        name=f"step{index}",
        title=title,
        key="numbers: explanations; bars: 95 % bands, with noise and the uncertainty of all values",
        body=plot(panel.drawn(title, axis_title, bars, marks, True), True, "step"),
        caption=f"The readings of {signal.id} show which explanation is true. A band has all that "
        "an explanation leaves open; much of that is the same in all steps, so these show more "
        "together than one by one.",
        narrow=True,
    )
