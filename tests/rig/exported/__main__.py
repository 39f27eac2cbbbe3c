"""Exported code in figures: lines, largest difference from the plan, and the same findings.

Run ``python -m tests.rig.exported`` for the figures, as JSON.
"""

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from rulec_runtime.recordings.csv_table import RecordingRefused

from rulec.export.c_printer import header, source
from rulec.export.module_code import code_of
from rulec.export.st_printer import blocks
from rulec.passes.pipeline import compile_plant
from tests.conftest import ROOT
from tests.figures.ledger import Share
from tests.rig.exported import split as parts
from tests.rig.exported.parsed import differences, expected, inputs_of, parsed
from tests.rig.exported.split import DEGREES, Judged, judged, real, same_story, shipped, split

PLANTS = (
    *("abc", "mixing-rig", "dosing-line", "zema-hydraulic"),
    *("esp-pump", "hsy-pumping", "cascaded-tanks", "wastewater-lab"),
)
POINTS = 4000
PARTS = 1e-15
"""Unit in which differences are told."""


def main() -> None:
    """Measure all and print it; ``--json -``, as other rigs have it, changes nothing."""
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        form = {"code": code(work), "split": findings(work), "first_order": slopes(work)}
    print(json.dumps(form, indent=1))


def code(work: Path) -> dict[str, Any]:
    """Lines per language over all shipped plants, and the largest differences from the plans."""
    modules = c_lines = st_lines = 0
    c_gap = st_gap = 0.0
    for name in PLANTS:
        ruleset = compile_plant(ROOT / "plants" / name)
        codes, folder = code_of(ruleset), work / name
        folder.mkdir()
        library = parts.compiled(codes, folder)
        for module in codes:
            text = blocks(module)
            modules += 1
            c_lines += header(module).count("\n") + source(module).count("\n")
            st_lines += text.count("\n")
            found = parsed(text)
            for routine in module.routines:
                values = inputs_of(routine, ruleset, POINTS, seed=1)
                plan = expected(routine, ruleset, values)
                block = found[f"{module.name}_{routine.name}"]
                c_gap = max(c_gap, differences(routine, library.run(routine, values), plan)[0])
                st_gap = max(st_gap, differences(routine, block.outputs(routine, values), plan)[0])
    return {
        "modules": modules,
        "c_lines": c_lines,
        "st_lines": st_lines,
        "c_largest_difference": c_gap / PARTS,
        "st_largest_difference": st_gap / PARTS,
    }


def findings(work: Path) -> dict[str, Any]:
    """Recordings judged by way of their modules: how many give the same findings as the whole."""
    given, first = [], []
    for i, (plant, recording) in enumerate([*shipped(), *real(work)]):
        folder = work / f"split{i}"
        folder.mkdir()
        try:
            found = split(compile_plant(plant), recording, folder)
        except RecordingRefused:
            continue  # it never settles, so there is nothing to tell
        given.append(same_story(found.whole, found.given))
        first.append(same_story(found.whole, found.first_order))
    return {
        "same_with_readings": Share(sum(given), len(given)).form(),
        "same_to_first_order": Share(sum(first), len(first)).form(),
    }


def slopes(work: Path) -> dict[str, Any]:
    """What is lost where faults are undone to first order, by degree."""
    folder = work / "first_order"
    folder.mkdir()
    pairs = list(judged(compile_plant(ROOT / "plants" / "abc"), folder))
    form: dict[str, Any] = {}
    for degree in DEGREES:
        own = [pair for pair in pairs if pair[0].degree == degree]
        form[f"{degree:g}"] = {
            name: _scored([pair[i] for pair in own])
            for i, name in enumerate(("whole", "first_order"))
        }
    return form


def _scored(judged: list[Judged]) -> dict[str, Any]:
    """How many faults are named, and by how much their degrees are off."""
    right = [j for j in judged if j.right]
    error = float(np.mean([j.error for j in right])) if right else 0.0
    return {"right": Share(len(right), len(judged)).form(), "error": error}


if __name__ == "__main__":
    main()
