"""The same chain on real recordings, where nobody planted anything: `rulec prove --real`.

There is no answer to open. What can be told: what was found where, how far the repaired model is
from readings that played no part in finding it, and how far it could be, by their noise.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rulec.engines.call import Engine
from rulec.prove.analyst import FORM
from rulec.prove.campaign import OnProgress, asked, owned
from rulec.prove.run_folder import CASES
from tests.conftest import recordings_folder as recordings_folder
from tests.rig.mismatch import esp, hsy, zema
from tests.rig.mismatch.case import Case, copy_plant, copy_rows

WHOSE = "real recordings"
"""Stands in a folder instead of the seals of a run."""


@dataclass(frozen=True)
class Source:
    """A folder of recordings; `cases` makes of it what the tool is shown, else `why` not."""

    folder: str
    cases: Callable[[Path, Path], Sequence[Case]] | None
    why: str = ""


@dataclass(frozen=True)
class Answer:
    """What the tool said of a case, in its machine form; `error` in it where it said nothing."""

    case: str
    plant: str
    form: Mapping[str, Any]


@dataclass(frozen=True)
class Planned:
    """A case and its folder, in the form of those that are sealed."""

    case: Case
    folder: Path


def tanks(folder: Path, work: Path) -> list[Case]:
    """The whole record of the cascaded tanks."""
    return [_whole("cascaded tanks", folder / "cascaded-tanks" / "estimation.csv", work)]


def lab(folder: Path, work: Path) -> list[Case]:
    """Both recordings of the waste-water laboratory."""
    files = {"on-off": "onoff_2021-12-30.csv.gz", "predictive": "gp_mpc_2022-01-04.csv.gz"}
    return [
        _whole(f"wastewater lab, {name} control", folder / "aau-wastewater-lab" / file, work)
        for name, file in files.items()
    ]


SOURCES = (
    Source("esp-viscous-pump-curves", esp.prepare),
    Source("zema-hydraulic", zema.prepare),
    Source("hsy-wastewater-pumping", hsy.prepare),
    Source("cascaded-tanks", tanks),
    Source("aau-wastewater-lab", lab),
    Source("skab", None, "no plant fits: pressure in steps of 0.33 bar, no data of pump and pipe"),
)
"""Pumps first, then plants that store, whose analysis takes longest."""


def answers(
    recordings: Path, work: Path, only: str, engine: Engine, on_progress: OnProgress
) -> tuple[list[Answer], list[str]]:
    """Ask about every recording that is there; also what was skipped, and why.

    Raises Changed where the folder is that of another run. What was answered in it stays.
    """
    owned(work, WHOSE)
    skipped = list(_skipped(recordings))
    there = [s for s in SOURCES if s.cases and (recordings / s.folder).is_dir()]
    planned: list[Planned] = []
    for count, source in enumerate(there, 1):
        planned += (p for p in _planned(source, recordings, work) if only in p.case.name)
        on_progress("preparing", count, len(there))
    for plan in planned:
        _lay_out(plan)
    asked([p.folder for p in planned], engine, on_progress)
    return [_answer(p) for p in planned], skipped


def _whole(name: str, source: Path, work: Path) -> Case:
    """A recording as it is, with the plant that has the columns of its folder."""
    plants = {"cascaded-tanks": "cascaded-tanks", "aau-wastewater-lab": "wastewater-lab"}
    shown = work / source.name.removesuffix(".gz")
    copy_rows(source, shown, lambda row: True)
    return Case(name, copy_plant(plants[source.parent.name], work), shown, shown)


def _skipped(recordings: Path) -> Iterator[str]:
    for source in SOURCES:
        if not (recordings / source.folder).is_dir():
            yield f"{source.folder}: not in {recordings} (set RULEC_RECORDINGS)"
        elif source.cases is None:
            yield f"{source.folder}: {source.why}"


def _planned(source: Source, recordings: Path, work: Path) -> Iterator[Planned]:
    place = work / CASES / source.folder
    place.mkdir(parents=True, exist_ok=True)
    for case in source.cases(recordings, place) if source.cases else ():
        yield Planned(case, place / re.sub(r"\W+", "-", case.name))


def _lay_out(planned: Planned) -> None:
    """Plant and recording under the names that the analyst knows."""
    case, plant = planned.case, planned.folder / "plant"
    shutil.copytree(case.plant.parent, plant, dirs_exist_ok=True)
    shutil.copyfile(case.plant, plant / "plant.yaml")
    shutil.copyfile(case.analysis, planned.folder / "recording.csv")


def _answer(planned: Planned) -> Answer:
    form = json.loads((planned.folder / FORM).read_text(encoding="utf-8"))
    return Answer(planned.case.name, planned.case.plant.parent.name, form)
