"""One sentence below each picture: what it shows, in numbers computed from what is drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.wall_clock import Calendar
from rulec_runtime.report.text import counted, degree, number, percent
from rulec_runtime.report.time_axis import told

from rulec.mismatch.answer.picture_data import Drawn, middle_by, rms, span
from rulec.mismatch.answer.wording import growth_words
from rulec.mismatch.result import HiddenDriver, Period, Shape


def say_time(drawn: Drawn) -> str:
    """Errors inside the located region and outside it."""
    inside, outside = drawn.located & drawn.judged, drawn.judged & ~drawn.located
    if not (inside.any() and outside.any()):
        return f"Over {counted(int(drawn.judged.sum()), 'point')} {_off(drawn)}."
    share = percent(float(inside.sum() / drawn.judged.sum()))
    return f"In the shaded {share} {_off(drawn.at(inside))}; outside it {_off(drawn.at(outside))}."


def say_detail(drawn: Drawn, calendar: Calendar | None) -> str:
    """Where the window lies, and the errors in it."""
    when = told(calendar, float(drawn.time[0]), float(drawn.time[-1]))
    return f"The part {when}, where most is at stake: {_off(drawn)}."


def _off(drawn: Drawn) -> str:
    before, after = rms(drawn.recalibrated_error), rms(drawn.repaired_error)
    words = f"the recalibrated model is off by {_amount(before, drawn.unit)} rms"
    if np.isfinite(after):
        words += f", the repaired one by {_amount(after, drawn.unit)}"
    return words


def say_driver(drawn: Drawn, title: str, readings: Array) -> str:
    """How far the median error moves over a driver, before and after; `readings` shape (n,)."""
    _, before = middle_by(readings, drawn.recalibrated_error)
    _, after = middle_by(readings, drawn.repaired_error)
    if not np.isfinite(before).any():
        return f"{title} does not vary enough to show anything."
    words = f"Over {title} the median error spans {_amount(span(before), drawn.unit)}"
    if np.isfinite(after).any():
        words += f" before the repair and {_amount(span(after), drawn.unit)} after it"
    return words + "."


def say_agreement(drawn: Drawn) -> str:
    """The largest distance from the diagonal."""
    parts = []
    for words, error in (
        ("recalibrated", drawn.recalibrated_error),
        ("repaired", drawn.repaired_error),
    ):
        size = np.abs(error[np.isfinite(error)])
        if len(size):
            largest, usual = float(size.max()), float(np.percentile(size, 95))
            parts.append(
                f"{words} {_amount(usual, drawn.unit)} ({_amount(largest, drawn.unit)} at most)"
            )
    return f"95\u00a0% of the points lie nearer to the diagonal than: {'; '.join(parts)}."


def say_periods(periods: Sequence[Period], calendar: Calendar | None) -> str:
    """How often, and the largest degree, or how it grows."""
    if any(p.growth for p in periods):
        return f"It {growth_words(periods[0])}."
    worst = max(periods, key=lambda p: abs(p.degree))
    return (
        f"{counted(len(periods), 'period')}; the largest degree is "
        f"{degree(worst.degree, worst.unit)}, "
        f"{told(calendar, worst.since, worst.until)}."
    )


def say_hidden(hidden: HiddenDriver) -> str:
    """The course in words, and its size."""
    unit = "" if hidden.unit == "1" else hidden.unit
    size = _amount(span(hidden.course), unit)
    text = hidden.text.rstrip(".") or "The course"
    return f"{text[:1].upper()}{text[1:]}; it spans {size}."


def say_shape(shape: Shape) -> str:
    """The shape in words, and whether the way there matters."""
    matters = {
        "yes": "It matters from which side the driver came",
        "no": "It does not matter from which side the driver came",
    }
    memory = matters.get(shape.memory, "Whether it matters from which side the driver came is open")
    return f"Over {shape.driver} {shape.text}. {memory}: {shape.memory_text}."


def _amount(value: float, unit: str) -> str:
    return f"{number(value, 2)} {unit}".rstrip() if unit != "1" else number(value, 2)
