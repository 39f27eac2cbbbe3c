"""What a user does after a first answer: plan an experiment, and judge both recordings together.

This file imports nothing of the truth, and its process gets paths of folders only.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from rulec.prove.analyst import ANSWER, FORM, answered, run_tool
from rulec.prove.limits import USUAL_HOURS

PLAN, ROUND = "experiment.json", "round-2"
FIRST, SECOND = "first.csv", "second.csv"
"""Recordings with dates: the first again, shared by all folders of a round, and a further one."""


def plan(folder: Path) -> dict[str, Any]:
    """`rulec experiment` on the first answer, no longer than the first recording or a shift.

    Returns its JSON form; `error` where the tool refuses. The folder keeps it.
    """
    return answered(folder / PLAN, lambda: _planned(folder))


def _planned(folder: Path) -> dict[str, Any]:
    recorded = (folder / "recording.csv").read_text(encoding="utf-8").splitlines()
    hours = max(float(recorded[-1].partition(",")[0]) / 3600.0, USUAL_HOURS)
    said = folder / "recipe.json"
    limits = folder / "limits.yaml"
    allowed = ("--limits", limits) if limits.exists() else ()
    run_tool("experiment", folder / ANSWER, "--hours", f"{hours:.6g}", "--json", said, *allowed)
    found: dict[str, Any] = json.loads(said.read_text(encoding="utf-8"))
    return found


def ask_again(folder: Path) -> dict[str, Any]:
    """`rulec mismatch` on both recordings; `folder` is that of one further recording.

    Returns the JSON form as `analyse` does; the folder keeps it.
    """
    return answered(folder / FORM, lambda: _again(folder))


def _again(folder: Path) -> dict[str, Any]:
    plant, answer = folder.parents[1] / "plant", folder / ANSWER
    recordings = folder.parent / FIRST, folder / SECOND
    run_tool("mismatch", plant, *recordings, "--json", answer)
    found: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    return found
