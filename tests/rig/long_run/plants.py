"""Rigs as they are compiled and as they truly are; recordings of them; the tool asked of one."""

import functools
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form

from rulec.cli import main
from rulec.commands.arguments import recording_given
from rulec.prove.truth.settled.drive import approach
from tests.conftest import compiled
from tests.dosing import TABLE_1, Plant, record, write_csv
from tests.dosing.plant import Operation
from tests.dosing.runs import HIGHEST, LOWEST, Run
from tests.method.readings import built as plant
from tests.rig.follower.agreement import followed
from tests.rig.long_run.readings import Columns

Form = Mapping[str, Any]
"""What `diagnose --json` writes."""

BLOCK = 60
"""Rows that a watch gets at once."""

QUICK = 5.0
"""Seconds between rows below which a speed is seen on its way to a new set point."""


def clock(rows: int, interval: float = 1.0) -> Array:
    return interval * np.arange(rows, dtype=np.float64)


def constant(rig: str, time: Array) -> dict[str, Array]:
    """All speeds at their nominal value, rev/s."""
    return {name: np.full(time.size, m.speed) for name, m in plant(rig).modules.items()}


def moving(rig: str, time: Array, hold: int, random: np.random.Generator) -> dict[str, Array]:
    """New speeds for all modules every `hold` rows, rev/s, inside what every pump can do."""
    found = {}
    for name, module in plant(rig).modules.items():
        share = random.uniform(LOWEST, HIGHEST, -(-time.size // hold))
        points = module.slowest + share * (module.fastest - module.slowest)
        points[0] = module.speed
        setting = np.repeat(points, hold)[: time.size]
        found[name] = approach(time, setting, 1.0) if time[1] < QUICK else setting
    return found


def recorded(
    rig: str,
    time: Array,
    seed: int,
    faults: Mapping[str, Array] | None = None,
    *,
    speed: Mapping[str, Array] | None = None,
    built: Plant | None = None,
    temperature: Mapping[str, Array] | None = None,
    backflow: bool = False,
) -> Columns:
    """Readings with the errors of the rig's sensors, by header, in trade units."""
    operation = Operation(time, speed or constant(rig, time), temperature=temperature or {})
    run = Run(built or plant(rig), operation, faults or {}, backflow)
    return record(run, TABLE_1, seed).readings


def given(rig: str, columns: Columns) -> Recording:
    return recording_given([dict(columns)], compiled(rig))


def asked(rig: str, columns: Columns) -> Form:
    """What the tool says of a whole recording."""
    return diagnosis_form(diagnose(given(rig, columns), compiled(rig)))


def watched(rig: str, columns: Columns) -> Form:
    """What a watch says when the recording has been played through it to its end."""
    return diagnosis_form(followed(compiled(rig), given(rig, columns), BLOCK).diagnosis)


@functools.cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="rulec-long-run-")


def command(rig: str, columns: Columns) -> Form:
    """What the command writes for a CSV file, with its exit code under `exit`."""
    folder = Path(_folder().name)
    rules, file, said = folder / f"{rig}.json", folder / "recording.csv", folder / "said.json"
    if not rules.exists():
        rules.write_text(compiled(rig).to_json(), encoding="utf-8")
    write_csv(file, columns, digits=8)
    words: Sequence[object] = ("diagnose", rules, file, "--quiet", "--json", said)
    try:
        code = main([str(word) for word in words])
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    return {**json.loads(said.read_text(encoding="utf-8")), "exit": code}
