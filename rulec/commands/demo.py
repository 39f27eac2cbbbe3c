"""`rulec demo`: the main job on a shipped example, end to end."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.report.terminal_findings import explain

from rulec.commands.demo_live import run_live
from rulec.commands.matrix import show
from rulec.knowledge.layers import shipped
from rulec.passes.compile_cache import ruleset_of_plant


def run(options: argparse.Namespace) -> int:
    """Compile the shipped plant, show its matrix, diagnose a recording made with a fault."""
    out = console(options)
    plant = shipped("plants") / "abc"
    if plant.is_relative_to(Path.cwd()):
        plant = plant.relative_to(Path.cwd())
    if options.live:
        return run_live(options, plant, out)
    truth = min((plant / "examples").glob("*.truth.csv"))
    recording = truth.with_name(truth.name.replace(".truth", ""))
    out.rule("1. compile: from module files to a fault-symptom matrix")
    out.print(f"$ rulec matrix {plant}")
    ruleset = ruleset_of_plant(plant)
    show(out, ruleset)
    out.rule("2. diagnose: a simulated recording with a fault that grows in steps")
    out.print(f"$ rulec diagnose {plant} {recording}")
    explain(out, diagnose(read_recording(recording, ruleset), ruleset))
    return 0
