"""What was judged with its diagnosis: all that can be told, drawn or written of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.steady.traced import Trace
from rulec_runtime.diagnosis.trace import trace
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.module_results import read_results
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form, trace_csv
from rulec_runtime.report.made import made_now
from rulec_runtime.report.page import report
from rulec_runtime.report.truth import Truth


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A recording of this name and its diagnosis, perhaps with what was truly wrong; results of
    modules hold no samples, and there is no recording then."""

    name: str
    recording: Recording | None
    diagnosis: Diagnosis
    truth: Truth | None = None

    @cached_property
    def trace(self) -> Trace:
        """What is said of every sample."""
        diagnosis = self.diagnosis
        return trace(self._sampled, diagnosis.ruleset, diagnosis.mode)

    def trace_csv(self) -> str:
        """One row per sample."""
        return trace_csv(self.trace)

    def form(self) -> dict[str, Any]:
        """The diagnosis as JSON data; flows in m3/s, times in s."""
        return diagnosis_form(self.diagnosis)

    def page(self) -> str:
        """The report, HTML."""
        made = made_now("rulec-runtime")
        return report(self._sampled, self.diagnosis, self.trace, self.name, self.truth, made)

    @property
    def _sampled(self) -> Recording:
        if self.recording is None:
            raise RecordingRefused(
                "a trace or report needs a recording; results of modules have no samples"
            )
        return self.recording


def judged(
    recording: Recording,
    ruleset: Ruleset,
    name: str,
    mode: str = "default",
    truth: Truth | None = None,
) -> Judged:
    """Diagnose a recording of this name."""
    found = diagnose(recording, ruleset, mode)
    return Judged(name=name, recording=recording, diagnosis=found, truth=truth)


def judged_results(file: Path, ruleset: Ruleset, mode: str, truth: bool) -> Judged:
    """Diagnose what modules say of themselves; raises `RecordingRefused` for what needs samples."""
    if truth:
        raise RecordingRefused("a truth needs a recording; results of modules have no samples")
    if mode != "default":
        raise RecordingRefused(
            f"--mode {mode} needs a recording: its rules read the sensors themselves"
        )
    found = diagnose_results(read_results(file, ruleset), ruleset)
    return Judged(name=file.resolve().name, recording=None, diagnosis=found)
