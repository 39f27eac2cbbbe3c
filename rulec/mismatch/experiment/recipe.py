"""An experiment as a recipe: the same table and words on the terminal and on a page."""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from rich.console import Console
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.terminal import styled
from rulec_runtime.report import parts as of_recipe
from rulec_runtime.report.chart import SYMBOLS, Axis, Figure, Panel, axis, figures_html
from rulec_runtime.report.document import Head, badge, document
from rulec_runtime.report.parts import Items, Part, Table, shown
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import fixed, listed, number, percent

from rulec.mismatch import limits
from rulec.mismatch.experiment.result import Experiment, Reading, alike, duration, in_words

READINGS = 2
"""Readings listed for each step."""


def tell(out: Console, found: Experiment, ruleset: Ruleset) -> None:
    """Print the result, the explanations, the steps, and remarks."""
    out.print(styled("\n[bold]{}[/]\n", found.headline))
    standing, steps, remarked = _content(found, ruleset)
    of_recipe.tell(out, [Part("", [standing])], margin=2)
    if found.steps:
        out.print("", shown(steps), "", sep="\n")
    out.print(shown(remarked))


def experiment_page(found: Experiment, ruleset: Ruleset, made: str = "") -> str:
    """The page as HTML; the same experiment gives the same text."""
    standing, steps, remarked = _content(found, ruleset)
    parts = [Part("What may be true", [standing])]
    if found.steps:
        listed = dict.fromkeys(r.signal for s in found.steps for r in s.readings[:READINGS])
        signals = (ruleset.signal_by_id[name] for name in listed)
        figures = [_picture(found, signal, i) for i, signal in enumerate(signals)]
        parts += [Part("Steps", [steps]), Part("Pictures", [figures_html(figures)])]
    named = [name.partition(".")[0] for one in found.standing for name in one.names]
    head = Head(
        kind="Experiment",
        verdict=found.headline.removesuffix("."),
        badge=badge("M" if found.steps else "C"),
        subject=Subject(ruleset=ruleset),
        marks=dict.fromkeys(named, "S"),
        made=made,
    )
    return document(head, [*parts, Part("Remarks", [remarked])])


def _content(found: Experiment, ruleset: Ruleset) -> tuple[Items, Table, Items]:
    """The explanations, the steps, and remarks."""
    standing = [f"{in_words(one)} ({percent(one.probability)})" for one in found.standing]
    remarked = Items(list(remarks(found, ruleset)))
    return Items(standing, numbered=True), _steps(found, ruleset), remarked


def _steps(found: Experiment, ruleset: Ruleset) -> Table:
    """A row per step; each reading of a step has a line."""
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
    return Table(titles, rows, broken=("set", "read"))


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
    extent = "the limits" if found.limited else "what was recorded"
    yield f"Set points were chosen within {extent}: {', '.join(ranges)}."
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
    title = f"{signal.id} as each explanation predicts it"
    beside = f"{signal.id} less the prediction of 1 [{signal.unit}]"
    ticks = tuple(float(place) for place in range(1, last + 1))
    low, high = off - spread, off + spread
    down = axis(float(np.min(low)), float(np.max(high)), 5, title=beside)
    panel = Panel(title, Axis(0.5, last + 0.5, ticks, title="step"), down, 240)
    for own in range(count):
        x = steps + SPREAD / max(count, 3) * (own - (count - 1) / 2.0)
        style, shape = f"s{own % 6}", list(SYMBOLS)[own % len(SYMBOLS)]
        panel.bars(x, low[:, own], high[:, own], style)
        panel.marks(x, off[:, own], shape, style)
        for a, b in zip(x, high[:, own], strict=True):
            panel.text(float(a), float(b), str(own + 1), "tick x", -6)
    return Figure(
        name=f"step{index}",
        title=title,
        key=[
            "numbers: explanations",
            "bars: 95 % bands, with noise and the uncertainty of all values",
        ],
        panels=[panel],
        caption=f"The readings of {signal.id} show which explanation is true. A band has all that "
        "an explanation leaves open; much of that is the same in all steps, so these show more "
        "together than one by one.",
        narrow=True,
    )
