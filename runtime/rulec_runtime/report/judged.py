"""A recording with its diagnosis: all that can be told, drawn or written of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.steady.traced import Trace
from rulec_runtime.diagnosis.trace import trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.json_form import diagnosis_form, trace_csv
from rulec_runtime.report.page import report
from rulec_runtime.report.truth import Truth


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A recording of this name and its diagnosis, perhaps with what was truly wrong."""

    name: str
    recording: Recording
    diagnosis: Diagnosis
    truth: Truth | None = None

    @cached_property
    def trace(self) -> Trace:
        """What is said of every sample."""
        diagnosis = self.diagnosis
        return trace(self.recording, diagnosis.ruleset, diagnosis.mode)

    def trace_csv(self) -> str:
        """One row per sample."""
        return trace_csv(self.trace, self.diagnosis.ruleset)

    def form(self) -> dict[str, Any]:
        """The diagnosis as JSON data; flows in m3/s, times in s."""
        return diagnosis_form(self.diagnosis)

    def page(self) -> str:
        """The report, HTML."""
        return report(self.recording, self.diagnosis, self.trace, self.name, self.truth)


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
