"""The analysis of a case, as a user would run it: with the plant's folder and the recording only.

This file imports nothing of the truth, and its process gets the path of a folder only.
"""

from __future__ import annotations

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

FORM, SERIES, EARLIER = "mismatch.json", "series.csv", "earlier.csv"
ANSWER = "answer.json"
"""What the tool wrote."""


def analyse(folder: Path) -> dict[str, Any]:
    """Calibrate the plant, if there is an earlier run, and run `rulec mismatch`.

    Returns the JSON form with `seconds`, its duration, and `error` where there is no answer. The
    folder keeps it, so that a run that was killed goes on where it was.
    """
    return answered(folder / FORM, lambda: _asked(folder))


def answered(form: Path, ask: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """The answer that a file keeps; asked, and kept in it, where it is not there."""
    if form.exists():
        kept: dict[str, Any] = json.loads(form.read_text(encoding="utf-8"))
        return kept
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
    """Calibrate the plant of a case, if there is an earlier run and it was not done yet."""
    plant = folder / "plant"
    file = plant / "plant.yaml"
    plain = file.read_text(encoding="utf-8")
    if (folder / EARLIER).exists() and "calibration:" not in plain:
        # Where the earlier run does not determine a parameter, a user keeps the data sheet.
        with contextlib.suppress(ValueError):
            run_tool("calibrate", plant, folder / EARLIER, "-o", plant / "calibration.yaml")
            write_text(file, f"{plain}calibration: [calibration.yaml]\n")


def _asked(folder: Path) -> dict[str, Any]:
    calibrate(folder)
    plant, answer = folder / "plant", folder / ANSWER
    series = folder / SERIES
    recording = folder / "recording.csv"
    run_tool("mismatch", plant, recording, "--json", answer, "--series", series)
    found: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    return found


def run_tool(*words: object) -> None:
    """A command of the tool; ValueError with its message where it refuses."""
    from rulec.cli import main

    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([str(word) for word in words])
        except SystemExit as stop:
            code = int(stop.code or 0)
    if code not in (0, UNSURE):
        raise ValueError(f"rulec {words[0]}: {' '.join(err.getvalue().split())[:300]}")
