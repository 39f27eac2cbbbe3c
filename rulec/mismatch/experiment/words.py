"""An experiment in words: what it is worth, what it leaves open, and which limit binds."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.report.text import counted, number, percent

from rulec.mismatch import limits
from rulec.mismatch.candidate_sets import Standing
from rulec.mismatch.experiment.result import Experiment, Reading

FEWEST_DIGITS, MOST_DIGITS = 3, 7
"""Digits of what is read."""


def headline(found: Experiment) -> str:
    """What the experiment is worth, in one sentence."""
    if len(found.standing) == 1:
        return _alone(found)
    if not found.telling:
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
        f"With {steps} in {duration(found.steps[-1].until)} the expected probability of the true "
        f"explanation rises from {percent(before)} to {percent(after)}, if it is one of these."
    )


def _alone(found: Experiment) -> str:
    """What there is to do where one explanation stands alone."""
    if not found.steps:
        return "One explanation stands alone, and nothing may be set that would test it."
    steps = counted(len(found.steps), "step")
    return (
        f"One explanation stands alone. {steps} in {duration(found.steps[-1].until)} test it: they "
        "explore the range that may be set, and show what it does not predict."
    )


def in_words(one: Standing) -> str:
    """What a set of explanations says."""
    return " and ".join(one.titles) or "nothing is missing"


def as_read(signal: SignalSpec, reading: Reading, place: int) -> str:
    """What is read if one explanation is true, to as many digits as tell it from the others."""
    value = reading.values[place]
    apart = max(reading.values) - min(reading.values)
    noise = apart / reading.apart if reading.apart > 0.0 else reading.spread[place]
    digits = math.ceil(math.log10(max(abs(value) / max(noise, 1e-300), 1.0))) + 1
    shown = f"{signal.shown(value):#.{min(max(digits, FEWEST_DIGITS), MOST_DIGITS)}g}"
    return shown.rstrip(".")


def as_set(signal: SignalSpec, value: float) -> str:
    return f"{signal.id} {number(signal.shown(value))} {signal.unit}"


def sure_after(found: Experiment, place: int) -> str:
    """How sure the true explanation can be expected to be after a step, 1 for the first; nothing
    where that is not foretold."""
    return "" if found.steps[place - 1].covers else percent(found.certainty[place])


def duration(seconds: float) -> str:
    if seconds < 120.0:
        return f"{seconds:.3g} s"
    return f"{number(seconds / 60.0)} min" if seconds < 7200.0 else f"{number(seconds / 3600.0)} h"


def remarks(found: Experiment, ruleset: Ruleset) -> Iterator[str]:
    if found.telling:
        yield _meaning(found)
    covers = [i for i, step in enumerate(found.steps, start=1) if step.covers]
    if covers and len(found.standing) > 1:
        yield (
            f"{_steps_of(covers).capitalize()} explore the range that may be set: they show if "
            "none of these explanations is true. No probability is predicted for them."
        )
    for first, second in found.alike:
        if found.telling:
            yield (f"No set points within these ranges tell {first + 1} and {second + 1} apart.")
        yield _sensor(found, (first, second))
    ranges = [
        f"{name} {number(min(ends))} to {number(max(ends))} {signal.unit}"
        for name, bounds in found.set_by.items()
        for signal in [ruleset.signal_by_id[name]]
        for ends in [[signal.shown(end) for end in bounds]]
    ]
    within = "the limits" if found.limited else "what was recorded"
    yield f"Set points were chosen within {within}: {', '.join(ranges)}."
    for one in found.left_out:
        yield (
            f"{in_words(one)} ({percent(one.probability)}) remains possible, too. Its effect at "
            "other set points is unknown, so nothing is predicted for it."
        )
    yield from _limits(found)


def _meaning(found: Experiment) -> str:
    """What a certainty says, and what it cannot."""
    listed = (
        f" The case that none of these is true ({percent(found.unlisted)}) counts as not sure."
        if found.unlisted >= limits.PLAUSIBLE
        else ""
    )
    return (
        f"Sure: the expected probability of the true explanation after the step.{listed} It relies "
        "on the probabilities above: if the truth has too little there, less is gained."
    )


def _sensor(found: Experiment, pair: tuple[int, int]) -> str:
    """The cheapest sensor that tells two explanations apart."""
    which = f"{pair[0] + 1} and {pair[1] + 1}"
    told = next((advised for advised in found.sensors if advised.pair == pair), None)
    if told is None:
        return (
            f"A second reading of any signal, or a flow meter, would not tell {which} apart either."
        )
    sensor, own = told.sensor, [v / told.sensor.factor for v in (*told.values, told.u)]
    cost = f" (it costs {number(sensor.cost)}, a pressure transmitter 1)" if sensor.cost else ""
    return (
        f"To tell {which} apart, add: {sensor.title}{cost}, {number(abs(own[0] - own[1]))} "
        f"{sensor.unit} apart, where the sensor is exact to {number(own[2])} {sensor.unit}."
    )


def _limits(found: Experiment) -> Iterator[str]:
    """What a step costs, and which limit forbids a better one."""
    costs: dict[tuple[str, ...], list[int]] = {}
    ends: dict[tuple[str, str], list[int]] = {}
    for place, step in enumerate(found.telling if found.limited else (), start=1):
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
    if len(places) > 2 and places[-1] - places[0] == len(places) - 1:
        return f"steps {places[0]} to {places[-1]}"
    return f"steps {', '.join(map(str, places[:-1]))} and {places[-1]}"
