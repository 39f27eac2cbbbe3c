"""A picture of a rig: the reading that counts on rows that were never shown, and what each plant
predicts of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from rulec_runtime.report.figure import Figure
from rulec_runtime.report.text import number

from rulec.mismatch.answer.pictures import ReadingCourses, over_time
from rulec.mismatch.result import Curves
from rulec.prove.real.ask import MODELS
from rulec.prove.real.score import Scored


def draw(scored: Scored) -> Figure | None:
    """Measured and predicted, and what each plant leaves; None where nothing was unseen."""
    found = scored.predicted.get(scored.signal, {})
    if not found.get("course"):
        return None
    order = np.argsort(found["course"]["time"], kind="stable")
    course = {name: np.array(values)[order] for name, values in found["course"].items()}
    course["repaired"] = course.pop("adopted")
    every = np.ones(len(course["time"]), dtype=bool)
    curves = Curves(**course, inside=every, heldout=~every, drivers={})
    figure = over_time(
        ReadingCourses(signal=scored.signal, unit=found["unit"], curves=curves, located=~every),
        None,
    )
    errors = ", ".join(f"{number(found[model], 3)} {model}" for model in MODELS)
    return replace(
        figure,
        name=f"rig-{scored.rig.name}",
        title=f"{scored.rig.name}: {scored.rig.title}",
        caption=f"Root mean square error in {found['unit']} on unseen rows: {errors}.",
    )
