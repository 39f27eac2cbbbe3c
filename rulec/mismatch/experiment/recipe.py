"""An experiment as a recipe: words and a table for the terminal, JSON data, and an input file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.output.csv_cell import row_of
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.text import counted, number, percent

from rulec.mismatch import limits
from rulec.mismatch.experiment.plan import Experiment, Reading, Step
from rulec.mismatch.experiment.sensors import Advised
from rulec.mismatch.result import Standing

FEWEST_DIGITS, MOST_DIGITS = 3, 7
"""Digits of what is read."""

ROWS = 10
"""Rows of the input file for each step."""


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
    for line in _remarks(found, ruleset):
        out.print(styled("{}", line))


def headline(found: Experiment) -> str:
    """What the experiment is worth, in one sentence."""
    if not found.steps:
        within, wider = "what was recorded", "Record wider ranges"
        if found.limited:
            within, wider = "the limits", "Allow wider ranges"
        return (
            f"No set points within {within} tell these explanations apart. {wider}, or read "
            "another quantity."
        )
    before, after = found.certainty[0], found.certainty[-1]
    steps = counted(len(found.steps), "step")
    return (
        f"{steps} in {_duration(found.steps[-1].until)}: the true explanation can be expected to "
        f"be {percent(after)} sure, {percent(before)} without."
    )


def in_words(one: Standing) -> str:
    """What a set of explanations says."""
    return " and ".join(one.titles) or "nothing is missing"


def _table(found: Experiment, ruleset: Ruleset) -> Table:
    signals = ruleset.signal_by_id
    table = Table(box=None, pad_edge=False, header_style="dim")
    slowly = any(step.ramp for step in found.steps)
    for title in ("step", "time" if slowly else "hold", "set"):
        table.add_column(title)
    table.add_column("read")
    for place in range(1, len(found.standing) + 1):
        table.add_column(f"if {place}", justify="right")
    table.add_column("sure", justify="right")
    for place, step in enumerate(found.steps, start=1):
        told = step.readings[: limits.READINGS_TOLD]
        hold = _duration(step.until - step.since - step.ramp)
        table.add_row(
            str(place),
            f"way {_duration(step.ramp)}\nhold {hold}" if slowly else hold,
            "\n".join(
                _shown(signals[name], value)
                for name, value in step.inputs.items()
                if name in found.set_by
            ),
            "\n".join(f"{r.signal} [{signals[r.signal].unit}]" for r in told),
            *(
                "\n".join(_read(signals[r.signal], r, i) for r in told)
                for i in range(len(found.standing))
            ),
            percent(found.certainty[place]),
        )
    return table


def _read(signal: SignalSpec, reading: Reading, place: int) -> str:
    """What is read if one explanation is true, to as many digits as tell it from the others."""
    value = reading.values[place]
    apart = max(reading.values) - min(reading.values)
    noise = apart / reading.apart if reading.apart > 0.0 else abs(value)
    digits = math.ceil(math.log10(max(abs(value) / max(noise, 1e-300), 1.0))) + 1
    return f"{signal.shown(value):.{min(max(digits, FEWEST_DIGITS), MOST_DIGITS)}g}"


def _shown(signal: SignalSpec, value: float) -> str:
    return f"{signal.id} {number(signal.shown(value))} {signal.unit}"


def _duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{number(seconds / 60.0)} min" if seconds < 7200.0 else f"{number(seconds / 3600.0)} h"


def _remarks(found: Experiment, ruleset: Ruleset) -> Iterator[str]:
    for first, second in found.alike:
        if found.steps:
            yield (
                f"{first + 1} and {second + 1} are not told apart by this: no set points within "
                "these ranges make them differ by enough."
            )
        yield _sensor(found, (first, second))
    ranges = [
        f"{name} {number(min(ends))} to {number(max(ends))} {signal.unit}"
        for name, bounds in found.set_by.items()
        for signal in [ruleset.signal_by_id[name]]
        for ends in [[signal.shown(end) for end in bounds]]
    ]
    within = "the limits" if found.limited else "what was recorded"
    yield f"Set points were chosen within {within}: {', '.join(ranges)}."
    yield from _limits(found)


def _sensor(found: Experiment, pair: tuple[int, int]) -> str:
    """The cheapest sensor that tells two explanations apart."""
    which = f"{pair[0] + 1} and {pair[1] + 1}"
    told = next((advised for advised in found.sensors if advised.pair == pair), None)
    if told is None:
        return (
            f"Nor does a second reading of anything, or a flow meter, tell {which} apart by enough."
        )
    sensor, own = told.sensor, [v / told.sensor.factor for v in (*told.values, told.u)]
    cost = f" (it costs {number(sensor.cost)}, a pressure transmitter 1)" if sensor.cost else ""
    return (
        f"What would tell {which}: {sensor.title}{cost}, {number(abs(own[0] - own[1]))} "
        f"{sensor.unit} apart, where the sensor itself is known to {number(own[2])} {sensor.unit}."
    )


def _limits(found: Experiment) -> Iterator[str]:
    """What a step costs, and which limit forbids a better one."""
    costs: dict[tuple[str, ...], list[int]] = {}
    ends: dict[tuple[str, str], list[int]] = {}
    for place, step in enumerate(found.steps if found.limited else (), start=1):
        if step.costs:
            costs.setdefault(step.costs, []).append(place)
        for end in step.at_end:
            ends.setdefault(end, []).append(place)
    for names, places in costs.items():
        yield f"Product is lost in {_steps_of(places)} (by {' and '.join(names)})."
    for (name, end_of), places in ends.items():
        yield f"The {end_of} value that is allowed of {name} binds in {_steps_of(places)}."
    for name in found.hindering:
        yield f"The limits of {name} forbid steps that would tell more."
    if found.time_is_short:
        yield "There is no time for steps that would tell more: --hours ends the experiment."
    for name in found.unwatched:
        yield f"No explanation foretells {name}, which has limits: watch it while you run this."


def _steps_of(places: Sequence[int]) -> str:
    if len(places) == 1:
        return f"step {places[0]}"
    return f"steps {', '.join(map(str, places[:-1]))} and {places[-1]}"


def experiment_form(found: Experiment, ruleset: Ruleset) -> dict[str, Any]:
    """The experiment as JSON data; values in the units of the signals, times in s."""
    signals = ruleset.signal_by_id
    return {
        "headline": headline(found),
        "explanations": [
            {"names": list(one.names), "title": in_words(one), "probability": one.probability}
            for one in found.standing
        ],
        "certainty": list(found.certainty),
        "factors": found.factors.tolist(),
        "alike": [list(pair) for pair in found.alike],
        "sensors": [_advised(one, signals) for one in found.sensors],
        "limits": {
            "given": found.limited,
            "forbid_more": list(found.hindering),
            "not_foretold": list(found.unwatched),
            "time_is_short": found.time_is_short,
        },
        "steps": [_step(step, signals) for step in found.steps],
    }


def _advised(one: Advised, signals: Mapping[str, SignalSpec]) -> dict[str, Any]:
    sensor = one.sensor
    return {
        "explanations": list(one.pair),
        "module": sensor.quantity[0],
        "signal": sensor.quantity[1] or None,
        "title": sensor.title,
        "class": sensor.kind.name,
        "cost": sensor.cost,
        "apart": one.apart,
        "difference": (one.values[1] - one.values[0]) / sensor.factor,
        "u": one.u / sensor.factor,
        "unit": sensor.unit,
        "at": {
            name: {"value": signals[name].shown(value), "unit": signals[name].unit}
            for name, value in one.at.items()
        },
    }


def _step(step: Step, signals: Mapping[str, SignalSpec]) -> dict[str, Any]:
    return {
        "from": step.since,
        "until": step.until,
        "ramp": step.ramp,
        "costs_product": list(step.costs),
        "at_end": [{"input": name, "end": end} for name, end in step.at_end],
        "inputs": {
            name: {"value": signals[name].shown(value), "unit": signals[name].unit}
            for name, value in step.inputs.items()
        },
        "readings": [
            {
                "signal": r.signal,
                "unit": signals[r.signal].unit,
                "values": [signals[r.signal].shown(value) for value in r.values],
                "apart": r.apart,
                "u": [spread / abs(signals[r.signal].factor) for spread in r.spread],
            }
            for r in step.readings
        ],
    }


def inputs_csv(found: Experiment, ruleset: Ruleset) -> str:
    """A recording of what is set, for `rulec simulate`; what nobody sets is as it was recorded."""
    signals = ruleset.signal_by_id
    names = sorted({name for step in found.steps for name in (*step.inputs, *step.given)})
    lines = [row_of(("time [s]", *(f"{name} [{signals[name].unit}]" for name in names)))]
    before: Mapping[str, float] = found.present
    for step in found.steps:
        values = {**step.given, **step.inputs}
        for part in range(ROWS):
            time = step.since + (step.until - step.since) * part / ROWS
            gone = (time - step.since) / step.ramp if time < step.since + step.ramp else 1.0
            now = {n: v + (1.0 - gone) * (before.get(n, v) - v) for n, v in values.items()}
            shown = [f"{signals[name].shown(now[name]):.8g}" for name in names]
            lines.append(row_of((f"{time:.10g}", *shown)))
        before = step.inputs
    return "\n".join(lines) + "\n"
