"""Run the tool on a rig, as a user does: commands as processes, in a folder of their own.

The folder gets the plain plant and the training recordings; nothing in it reveals where the rig is.
`test.csv` is copied there after the tool has answered, for `rulec simulate` only. The sealed answer
is never copied.
"""

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rulec_runtime
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording import Recording, read_recording

import rulec
from rulec.limits import UNSURE
from rulec.passes.pipeline import compile_plant
from rulec.prove.analyst import ANSWER, EARLIER, answered, read_form
from rulec.prove.real.rig_folder import PLAIN, PLANT, TEST, TRAIN, Rig, write_yaml, yaml_of

TOOL = "rulec.prove.real.tool_process"
ASKED = "asked.json"
MODELS = ("shipped", "recalibrated", "adopted")
FOLDERS = {"shipped": "plant", "recalibrated": "recalibrated", "adopted": "adopted"}
NOTHING: Mapping[str, Any] = {"form": None, "error": "", "refused": "", "predicted": {}}
"""The result before anything is answered."""

DRAWN = 400
"""Most unseen rows in a picture."""

MESSAGE = 300
"""Characters of a message that are kept."""


class NoAnswer(Exception):
    """A command gave no result; the message says why."""


@dataclass(frozen=True)
class Commands:
    """Runs commands of the tool in a folder, all of them within `limit` seconds each."""

    folder: Path
    limit: float

    def run(self, *words: object) -> None:
        """Run a command, which ends if this process does; raises `NoAnswer` with the end of its
        message if it fails."""
        sources = (str(Path(p.__path__[0]).parent) for p in (rulec, rulec_runtime))
        lifeline, ours = os.pipe()
        try:
            done = subprocess.run(
                [sys.executable, "-m", TOOL, *map(str, words)],
                cwd=self.folder,
                # Where this very tool is, so that its processes run no other.
                env={**os.environ, "PYTHONPATH": os.pathsep.join(sources)},
                stdin=lifeline,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                timeout=self.limit,
                check=False,
                # Ctrl-C is for `rulec prove`; an interrupted command would be taken for an answer.
                start_new_session=True,
            )
        except subprocess.TimeoutExpired:
            raise NoAnswer(f"rulec {words[0]}: no answer in {self.limit:.0f} s") from None
        finally:
            os.close(lifeline)
            os.close(ours)
        if done.returncode not in (0, UNSURE):
            said = " ".join(done.stderr.split())[-MESSAGE:]
            raise NoAnswer(f"rulec {words[0]}: {said or f'exit {done.returncode}'}")


def lay_out(rig: Rig, folder: Path) -> None:
    """Copy the plant and the training recordings under names that reveal nothing."""
    if folder.exists():
        return
    shutil.copytree(rig.folder / PLAIN, folder / "plant")
    for number, file in enumerate(rig.train, 1):
        shutil.copyfile(file, folder / f"{TRAIN}-{number}{_suffix(file)}")
    if rig.earlier:
        shutil.copyfile(rig.earlier, folder / f"earlier{_suffix(rig.earlier)}")


def ask(folder: Path, test: Path | None, limit: float) -> dict[str, Any]:
    """Return the tool's answer and its plants' predictions of `test`; kept in the folder.

    Keys: `form` (the JSON of `rulec mismatch`, None without an answer), `error`, `refused` (why
    nothing was adopted), `predicted` by signal, and `seconds`.
    """

    def asked() -> dict[str, Any]:
        commands, found = Commands(folder, limit), dict[str, Any](NOTHING)
        try:
            _calibrate(commands)
            shown = sorted(p.name for p in folder.glob(f"{TRAIN}-*"))
            commands.run("mismatch", "plant", *shown, "--json", ANSWER, "--quiet")
            found["form"] = read_form(folder / ANSWER)
        except NoAnswer as failure:
            found["error"] = str(failure)
        if test is not None:
            adopt = "adopt", ANSWER, "--quiet", "-o"
            if found["form"]:
                with contextlib.suppress(NoAnswer):
                    commands.run(*adopt, FOLDERS["recalibrated"], "--recalibrated")
                try:
                    commands.run(*adopt, FOLDERS["adopted"])
                except NoAnswer as failure:
                    found["refused"] = str(failure)
            found["predicted"] = predicted(commands, test)
        return found

    return {**NOTHING, **answered(folder / ASKED, asked)}


def _calibrate(commands: Commands) -> None:
    """Calibrate the plain plant if there is an earlier run."""
    plant = commands.folder / "plant"
    for earlier in commands.folder.glob(f"{Path(EARLIER).stem}.csv*"):
        try:
            commands.run("calibrate", "plant", earlier.name, "-o", "plant/found.yaml", "--quiet")
        except NoAnswer:
            return  # parameters that an earlier run does not determine stay as in the data sheet
        write_yaml(plant / PLANT, {**yaml_of(plant / PLANT), "calibration": ["found.yaml"]})


def predicted(commands: Commands, test: Path) -> dict[str, dict[str, Any]]:
    """Return by signal: unit, number of rows that every plant predicts, and each plant's RMS error.

    `course` has some of the rows. A plant that was not written predicts as the one before it.
    """
    rules = compile_plant(commands.folder / FOLDERS["shipped"] / PLANT)
    copy = commands.folder / f"{TEST}{_suffix(test)}"
    shutil.copyfile(test, copy)
    off, measured = {}, read_recording(copy, rules)
    for model, name in FOLDERS.items():
        if (commands.folder / name / PLANT).is_file():
            with contextlib.suppress(NoAnswer):
                target = f"{model}.csv"
                commands.run("simulate", name, copy.name, "-o", target, "--quiet")
                off[model] = off_of(rules, commands.folder / target, measured)
    moved = [n for n in off.get("shipped", {}) if any(np.nansum(abs(o[n])) for o in off.values())]
    own = {n: {m: o[n] for m, o in off.items()} for n in moved}
    return {n: _errors(rules.signal_by_id[n], measured, own[n]) for n in moved}


def off_of(rules: Ruleset, target: Path, measured: Recording) -> dict[str, Array]:
    """Return by signal, simulated minus measured in its unit, shape (n,); NaN if a row does not
    count: a reading of its module is below its minimum, as when a pump stands still."""
    simulated, found = read_recording(target, rules).values, {}
    for signal in rules.signals:
        if signal.id in simulated and signal.id in measured.values:
            off = (simulated[signal.id] - measured.values[signal.id]) / signal.factor
            for other in rules.signals:
                alike = other.id.partition(".")[0] == signal.id.partition(".")[0]
                if alike and other.minimum is not None and other.id in measured.values:
                    off = np.where(measured.values[other.id] >= other.minimum, off, np.nan)
            found[signal.id] = off
    return found


def _errors(signal: SignalSpec, measured: Recording, off: Mapping[str, Array]) -> dict[str, Any]:
    finite = np.all([np.isfinite(o) for o in off.values()], axis=0)
    found: dict[str, Any] = {"unit": signal.unit, "rows": int(finite.sum())}
    if not finite.any() or "shipped" not in off:
        return {**found, **dict.fromkeys(MODELS)}
    rows = np.flatnonzero(finite)
    some = rows[np.unique(np.linspace(0, len(rows) - 1, DRAWN).astype(int))]
    reading = (measured.values[signal.id] - signal.offset) / signal.factor
    course = {"time": measured.time[some], "measured": reading[some]}
    own = off["shipped"]
    for model in MODELS:
        own = off.get(model, own)
        found[model] = float(np.sqrt(np.mean(own[rows] ** 2)))
        course[model] = reading[some] + own[some]
    return {**found, "course": {k: v.tolist() for k, v in course.items()}}


def _suffix(file: Path) -> str:
    return ".csv.gz" if file.name.endswith(".gz") else ".csv"
