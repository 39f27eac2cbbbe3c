"""When a fault begins and ends, closer than the windows that show it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec_runtime import limits
from rulec_runtime.diagnosis.stores.judge import Judged
from rulec_runtime.diagnosis.stores.window_fit import Model
from rulec_runtime.diagnosis.stores.windows import Windows


def edge_of(
    model: Model,
    windows: Windows,
    sound: Judged,
    faulty: Judged,
    fault: str,
    degree: float,
) -> float:
    """The time between a sound window and a faulty one at which a fault of a degree sets in.

    Where the faulty one comes first, it is the time at which the fault ends.
    """
    begins = sound.window.first < faulty.window.first
    one, other = (sound, faulty) if begins else (faulty, sound)
    window = windows.joined(one.window, other.window)
    assert one.plain is not None
    moved = model.with_course_of(fault)
    guess = replace(one.plain.guess, degrees=np.zeros(0))
    places = np.unique(np.linspace(0, len(window.time) - 1, limits.EDGE_PLACES).astype(int))
    best, when = np.inf, float(window.time[0])
    for place in places.tolist():
        later = np.arange(len(window.time)) >= place
        course = np.where(later == begins, degree, 0.0)
        own = replace(window, inputs=np.column_stack([window.inputs, course]))
        found = moved.fit(own, sound.known, guess)
        if found is not None and found.chi < best:
            best, when, guess = found.chi, float(window.time[place]), found.guess
    return when
