"""A diagnosed recording, with all forms of its result."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rich.console import Console

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.verdict_per_sample import Trace, trace
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.module_results import holds_results, read_results
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.json_form import diagnosis_form, trace_csv
from rulec_runtime.report.page import report
from rulec_runtime.report.page_origin import made_now
from rulec_runtime.report.terminal_findings import explain
from rulec_runtime.report.truth import Truth, read_truth


@dataclass(frozen=True, kw_only=True)
class Judged:
    """A named recording with its diagnosis, perhaps with the truth; results of modules have no
    samples, so their recording is None."""

    name: str
    recording: Recording | None
    diagnosis: Diagnosis
    truth: Truth | None = None

    @cached_property
    def trace(self) -> Trace:
        """The result for every sample."""
        return trace(self._sampled, self.diagnosis.ruleset, self.diagnosis.mode)

    def trace_csv(self) -> str:
        """One row per sample."""
        return trace_csv(self.trace)

    def to_dict(self) -> dict[str, Any]:
        """The diagnosis as `rulec diagnose --json` writes it; flows in m3/s, times in s."""
        return diagnosis_form(self.diagnosis)

    def page(self) -> str:
        """The report, one page of HTML with pictures."""
        made = made_now("rulec-runtime")
        return report(self._sampled, self.diagnosis, self.trace, self.name, self.truth, made)

    def tell(self, out: Console) -> None:
        """Print the whole story."""
        explain(out, self.diagnosis)

    @property
    def _sampled(self) -> Recording:
        if self.recording is None:
            raise RecordingRefused(
                "a trace or report needs a recording; results of modules have no samples"
            )
        return self.recording


def judged(
    file: Path,
    ruleset: Ruleset,
    mode: str = "default",
    truth: Path | None = None,
    recording: Recording | None = None,
) -> Judged:
    """Diagnose a recording, or results of modules; a `recording` in memory is not read from a file.

    Raises `RecordingRefused` if it is no recording of the plant, or for options that need samples.
    """
    if recording is None and holds_results(file, ruleset):
        if truth is not None:
            raise RecordingRefused("a truth needs a recording; results of modules have no samples")
        if mode != "default":
            raise RecordingRefused(
                f"--mode {mode} needs a recording: its rules read the sensors themselves"
            )
        found = diagnose_results(read_results(file, ruleset), ruleset)
        return Judged(name=file.resolve().name, recording=None, diagnosis=found)
    read = read_recording(file, ruleset) if recording is None else recording
    true = None if truth is None else read_truth(truth, ruleset, read)
    found = diagnose(read, ruleset, mode)
    return Judged(name=file.resolve().name, recording=read, diagnosis=found, truth=true)
