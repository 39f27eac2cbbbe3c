"""`rulec demo`: the main job on a shipped example, end to end."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec.commands.matrix import show
from rulec.commands.output import console
from rulec.pipeline import compile_plant
from rulec.read import shipped
from runtime.diagnose import diagnose
from runtime.explain import explain
from runtime.recording import read_recording


def run(options: argparse.Namespace) -> int:
    """Compile the shipped plant, show its matrix, diagnose a recorded leakage."""
    out = console(options)
    plant = shipped("plants") / "abc"
    if plant.is_relative_to(Path.cwd()):
        plant = plant.relative_to(Path.cwd())
    recording = plant / "examples" / "leakage_A.csv"
    out.rule("1. compile: from module files to a fault-symptom matrix")
    out.print(f"$ rulec matrix {plant}", markup=False)
    ruleset = compile_plant(plant)
    show(out, ruleset)
    out.rule("2. diagnose: a recording in which pump A leaks more and more")
    out.print(f"$ rulec diagnose {plant} {recording}", markup=False)
    explain(out, diagnose(read_recording(recording, ruleset), ruleset))
    return 0
