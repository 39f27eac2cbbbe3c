"""Call the command line as a user does, and read its machine form."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rulec.limits import UNSURE
from tests.conftest import SOURCES
from tests.rig.mismatch.case import Case

PATIENCE = 1800.0
"""Seconds after which a call counts as failed."""

FAULTS = ("fault", "sensor")


class Failed(Exception):
    """The command gave no result; the message is the end of what it wrote."""


@dataclass(frozen=True)
class Answer:
    """What `rulec mismatch` said; `file` is its machine form, `seconds` the wall time."""

    form: Mapping[str, Any]
    file: Path
    seconds: float

    @property
    def verdict(self) -> str:
        """One word."""
        return str(self.form["verdict"])

    @property
    def named(self) -> list[tuple[str, str, str, float]]:
        """Effect, module, place and probability of all that was named."""
        return [
            (e["effect"], e["module"], e["place"], float(e["probability"]))
            for e in self.form["effects"]
        ]

    @property
    def periods(self) -> list[tuple[float, float]]:
        """Periods of faults that were named, s."""
        return [_span(p) for e in self.form["effects"] for p in e.get("periods", ())]

    def periods_of(self, fault: str) -> list[tuple[float, float]]:
        """Periods of one fault."""
        named = (e for e in self.form["effects"] if e["effect"] == fault)
        return [_span(p) for e in named for p in e.get("periods", ())]

    @property
    def located(self) -> list[tuple[float, float]]:
        """Periods of all places that were found wrong, s."""
        return [_span(p) for place in self.form["locations"] for p in place["periods"]]


def _span(period: Any) -> tuple[float, float]:
    """A period is a pair, or carries `since` and `until`."""
    if isinstance(period, Mapping):
        return float(period["since"]), float(period["until"])
    return float(period[0]), float(period[1])


def exists(command: str) -> bool:
    """Whether the tool has this command."""
    return importlib.util.find_spec(f"rulec.commands.{command}") is not None


def call(*arguments: object) -> float:
    """Run `rulec`; returns seconds. Raises `Failed` unless it exits 0."""
    begin = time.perf_counter()
    try:
        done = subprocess.run(
            [sys.executable, "-m", "rulec", *(str(a) for a in arguments)],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            env={**os.environ, "PYTHONPATH": SOURCES},
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise Failed(f"no answer within {PATIENCE:.0f} s") from None
    if done.returncode not in (0, UNSURE):
        raise Failed("\n".join(done.stderr.strip().splitlines()[-3:]))
    return time.perf_counter() - begin


def ask(case: Case, folder: Path) -> Answer:
    """`rulec mismatch` on what a case shows."""
    file = folder / f"{case.name.replace(' ', '-')}.mismatch.json"
    seconds = call("mismatch", case.plant, case.analysis, "--json", file)
    return Answer(json.loads(file.read_text(encoding="utf-8")), file, seconds)


def adopt(answer: Answer) -> Path:
    """`rulec adopt`: the folder of the repaired plant."""
    target = answer.file.with_suffix(".adopted")
    call("adopt", answer.file, "-o", target)
    return target


def simulate(plant: Path, inputs: Path, target: Path) -> Path:
    """`rulec simulate`: the predicted recording."""
    call("simulate", plant, inputs, "-o", target)
    return target


def diagnose(plant: Path, recording: Path, target: Path) -> Mapping[str, Any]:
    """`rulec diagnose`: its machine form."""
    call("diagnose", plant, recording, "--json", target)
    form: Mapping[str, Any] = json.loads(target.read_text(encoding="utf-8"))
    return form


def detectable(plant: Path, fault: str, target: Path) -> float:
    """Smallest degree of a fault that leaves the threshold of some residual."""
    call("matrix", plant, "--json", target)
    form = json.loads(target.read_text(encoding="utf-8"))
    degrees = form["detectable"][form["faults"].index(fault)]
    return min((float(d) for d in degrees if d), default=float("nan"))
