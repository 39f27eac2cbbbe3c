"""What a user does with a case: analyse it, plan an experiment, analyse both recordings together.

This file imports nothing of the truth, and its processes get paths of folders only.
"""

import contextlib
import io
import json
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rulec_runtime.output.write_file import write_text

from rulec.limits import UNSURE
from rulec.prove.limits import USUAL_HOURS

FORM, SERIES, EARLIER = "mismatch.json", "series.csv", "earlier.csv"
ANSWER = "answer.json"
"""The file that the tool writes."""

PLAN, ROUND = "experiment.json", "round-2"
FIRST, SECOND = "first.csv", "second.csv"
"""Recordings with dates: the first, shared by all folders of a round, and the further one."""


def analyse(folder: Path) -> dict[str, Any]:
    """Calibrate the plant, if there is an earlier run, and run `rulec mismatch`.

    Returns the JSON form with `seconds`, its duration, and `error` if there is no answer. The
    folder keeps it, so that a run that was killed can be resumed.
    """

    def ask() -> dict[str, Any]:
        calibrate(folder)
        answer, files = folder / ANSWER, (folder / "plant", folder / "recording.csv")
        run_tool("mismatch", *files, "--json", answer, "--series", folder / SERIES)
        return read_form(answer)

    return answered(folder / FORM, ask)


def plan(folder: Path) -> dict[str, Any]:
    """Run `rulec experiment` on the first answer, no longer than the first recording or a shift.

    Returns its JSON form; `error` if the tool refuses. The folder keeps it.
    """

    def ask() -> dict[str, Any]:
        recorded = (folder / "recording.csv").read_text(encoding="utf-8").splitlines()
        hours = max(float(recorded[-1].partition(",")[0]) / 3600.0, USUAL_HOURS)
        recipe, limits = folder / "recipe.json", folder / "limits.yaml"
        allowed = ("--limits", limits) if limits.exists() else ()
        words = ("--hours", f"{hours:.6g}", "--json", recipe, *allowed)
        run_tool("experiment", folder / ANSWER, *words)
        return read_form(recipe)

    return answered(folder / PLAN, ask)


def ask_again(folder: Path) -> dict[str, Any]:
    """Run `rulec mismatch` on both recordings; `folder` is that of one further recording.

    Returns the JSON form as `analyse` does; the folder keeps it.
    """

    def ask() -> dict[str, Any]:
        plant, answer = folder.parents[1] / "plant", folder / ANSWER
        run_tool("mismatch", plant, folder.parent / FIRST, folder / SECOND, "--json", answer)
        return read_form(answer)

    return answered(folder / FORM, ask)


def read_form(file: Path) -> dict[str, Any]:
    """Read a JSON form that the tool or the proof wrote."""
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def answered(form: Path, ask: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Return the answer in a file; if the file does not exist, ask and write it first."""
    if form.exists():
        return read_form(form)
    begin = time.perf_counter()
    try:
        found = ask()
    except Exception as failure:  # a crash of the tool is a result
        last = traceback.extract_tb(failure.__traceback__)[-1]
        found = {"error": f"{type(failure).__name__}: {failure} ({last.name}:{last.lineno})"}
    found["seconds"] = time.perf_counter() - begin
    write_text(form, json.dumps(found))
    return found


def calibrate(folder: Path) -> None:
    """Calibrate the plant of a case, if there is an earlier run and it is not calibrated yet."""
    plant = folder / "plant"
    file = plant / "plant.yaml"
    plain = file.read_text(encoding="utf-8")
    if (folder / EARLIER).exists() and "calibration:" not in plain:
        # If the earlier run does not determine a parameter, a user keeps the data sheet.
        with contextlib.suppress(ValueError):
            run_tool("calibrate", plant, folder / EARLIER, "-o", plant / "calibration.yaml")
            write_text(file, f"{plain}calibration: [calibration.yaml]\n")


def run_tool(*words: object) -> None:
    """Run a command of the tool; raises ValueError with its message if it refuses."""
    from rulec.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([str(word) for word in words])
        except SystemExit as stop:
            code = int(stop.code or 0)
    if code not in (0, UNSURE):
        raise ValueError(f"rulec {words[0]}: {' '.join(err.getvalue().split())[:300]}")
