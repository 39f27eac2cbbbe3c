"""What the models of a fleet leave out: an answer per plant-day, and one table of all answers.

A plant-day is done if its answer exists. The name of the file holds the key of the work, as in
`rulec.fleet.store`.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rulec_runtime.fleet.plant_day import Task
from rulec_runtime.output.plural import plural
from rulec_runtime.output.write_file import write_data

from rulec.fleet.store import PlantDays, parquet_of

SOUND = "none"
"""Verdict if a model and its plant agree."""

UNASKED = "unread"
"""Verdict if the recording could not be analysed."""

UNTOLD = ("cannot judge", UNASKED)
"""Verdicts that say nothing about a model."""


@dataclass(frozen=True, kw_only=True)
class Answer:
    """The result of `rulec mismatch` for a plant-day.

    Attributes
    ----------
    verdict : of `rulec mismatch`, or ``unread``, with a `reason`.
    text : the answer in a sentence or two.
    module, place, effect, title : of the first explanation; empty if there is none.
    probability : of that explanation; None if there is none.
    signal, unit : the predicted signal, and the unit of its errors at held-out points.
    shipped, recalibrated, repaired, noise : root mean square errors of the model as it is, with
        other values, with what it left out, and of readings alone; None if nothing was compared.
    """

    plant: str
    day: str
    verdict: str
    text: str = ""
    reason: str = ""
    module: str = ""
    place: str = ""
    effect: str = ""
    title: str = ""
    probability: float | None = None
    signal: str = ""
    unit: str = ""
    shipped: float | None = None
    recalibrated: float | None = None
    repaired: float | None = None
    noise: float | None = None


def answer_of(task: Task, form: Mapping[str, Any]) -> Answer:
    """The row of an answer in JSON form, or of a reason why there is none."""
    if "reason" in form:
        return Answer(plant=task.plant, day=task.day, verdict=UNASKED, reason=form["reason"])
    none: dict[str, Any] = {}
    first = next(iter(form["effects"]), none)
    where = next(iter(form["locations"]), none)
    fit = form["fit"] or none
    heldout = fit.get("heldout") or none
    names = ("shipped", "recalibrated", "repaired", "noise")
    errors: dict[str, Any] = {name: heldout.get(name) for name in names}
    return Answer(
        plant=task.plant,
        day=task.day,
        verdict=form["verdict"],
        text=form["headline"],
        module=where.get("module", ""),
        place=where.get("place", ""),
        effect=first.get("effect") or "",
        title=first.get("title", ""),
        probability=first.get("probability"),
        signal=fit.get("signal", ""),
        unit=fit.get("unit", ""),
        **errors,
    )


class Answers(PlantDays):
    """Answers in a folder."""

    def __init__(self, folder: Path, plant_key: str, day_key: str) -> None:
        super().__init__(folder, plant_key, day_key, "mismatch-answers", ".json")

    def keep(self, task: Task, form: Mapping[str, Any]) -> None:
        """Write an answer."""
        self.put(task, (json.dumps(form, indent=1, ensure_ascii=False) + "\n").encode())

    def rows(self, tasks: Iterable[Task]) -> list[Answer]:
        """Rows of plant-days that are done."""
        return [
            answer_of(task, json.loads(self.file(task).read_text(encoding="utf-8")))
            for task in tasks
        ]

    def write_table(self, rows: Sequence[Answer]) -> Path:
        """Write all rows as one Parquet file; returns its path."""
        import pyarrow

        numbers = ("probability", "shipped", "recalibrated", "repaired", "noise")
        schema = pyarrow.schema(
            (name, pyarrow.float64() if name in numbers else pyarrow.string())
            for name in Answer.__dataclass_fields__
        )
        file = self.folder / "mismatch.parquet"
        write_data(file, parquet_of(map(asdict, rows), schema))
        return file


def differing(rows: Iterable[Answer]) -> list[Answer]:
    """Plant-days that differ from their models."""
    return [row for row in rows if row.verdict not in (SOUND, *UNTOLD)]


def summary(rows: Sequence[Answer]) -> str:
    """All answers in a sentence: how many plants differ, and by what most often."""
    plants = {row.plant for row in rows}
    off = differing(rows)
    which = {row.plant for row in off}
    if not which:
        sound = {row.plant for row in rows if row.verdict == SOUND}
        agree = plural(len(sound), "plant agrees with its model", "plants agree with their models")
        return agree if sound else "no recording says anything of a model"
    differ = "differs from its model" if len(which) == 1 else "differ from their models"
    text = f"{len(which)} of {plural(len(plants), 'plant', 'plants')} {differ}"
    each = Counter(title for title, _ in {(row.title, row.plant) for row in off if row.title})
    title, count = min(each.items(), key=lambda one: (-one[1], one[0]), default=("", 0))
    return f"{text}; most often by: {title} ({count} plants)" if count > 1 else text
