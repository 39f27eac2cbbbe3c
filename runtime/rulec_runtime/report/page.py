"""Assemble the report of a diagnosis: findings, evidence, pictures, matrix, origin."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.verdict_per_sample import Trace, trace
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.module_results import read_results
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.blindness import told_else
from rulec_runtime.report.chart import figures_html
from rulec_runtime.report.document import Head, badge, document
from rulec_runtime.report.figures import figures_of
from rulec_runtime.report.html_findings import UNSEEN, evidence, remarks, told
from rulec_runtime.report.json_form import diagnosis_form, trace_csv
from rulec_runtime.report.matrix_html import matrix
from rulec_runtime.report.page_origin import made_now
from rulec_runtime.report.parts import Content, Drawing, Facts, Part, Words
from rulec_runtime.report.series import curves_of
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import counted, percent
from rulec_runtime.report.truth import Truth, cases_of
from rulec_runtime.report.verdict import marks, meaning, verdict


def report(
    recording: Recording,
    diagnosis: Diagnosis,
    trace: Trace,
    name: str,
    truth: Truth | None = None,
    made: str = "",
) -> str:
    """Write a report; the same input gives the same text.

    Parameters
    ----------
    trace : of the same recording, ruleset and mode as the diagnosis.
    name : of the recording, for the reader.
    truth : the true faults; without it nothing is compared.
    made : when and by what; left out if empty.
    """
    cases = cases_of(truth, trace) if truth is not None else None
    curves = curves_of(examine(recording, diagnosis.ruleset).recording, diagnosis, trace)
    ruleset, why = diagnosis.ruleset, list[Content](evidence(diagnosis))
    parts = [*told(diagnosis), Part("Why", why or [Words(_nothing(diagnosis))])]
    figures = [*figures_of(diagnosis, curves, trace, truth, cases)]
    if figures:
        parts.append(Part("Pictures", [Drawing(figures_html(figures))]))
    if ruleset.residuals:
        parts.append(Part("What each fault would do", [matrix(diagnosis)]))
    parts.append(Part("Where this comes from", _facts(diagnosis, truth)))
    head = Head(
        kind="Diagnosis",
        verdict=verdict(diagnosis),
        meaning=meaning(diagnosis),
        badge=badge(diagnosis.status),
        subject=Subject.of(ruleset, recording, name),
        marks=marks(diagnosis),
        made=made,
    )
    return document(head, parts)


def _nothing(diagnosis: Diagnosis) -> str:
    """Replaces the evidence if there is no finding."""
    if not diagnosis.judged:
        return "Nothing could be judged; the reasons are above."
    if diagnosis.unknown:
        return "The pictures show which estimates disagree; no known fault explains how."
    if diagnosis.ruleset.dynamics is not None:
        return "All readings are as the balances predict, wherever they could be judged."
    return (
        "All estimates of the same flow agree within their uncertainty wherever the recording "
        "could be judged."
    )


def _facts(diagnosis: Diagnosis, truth: Truth | None) -> list[Content]:
    ruleset = diagnosis.ruleset
    share = percent(diagnosis.judged / max(diagnosis.samples, 1))
    parts = "windows" if ruleset.dynamics is not None else "settled stretches"
    amount = f"{counted(diagnosis.judged, 'sample')} ({share}) in {parts}"
    mode = {
        "default": "default: the whole residual vector with its uncertainties",
        "paper": "paper: Eqs. 17 to 19 of Wetterich, Kuhr, Pelz 2025 as printed",
    }[diagnosis.mode]
    paper = "Figures 7 to 10 of Wetterich, Kuhr, Pelz, Processes 2025, 13(10), 3293"
    origins = dict.fromkeys(f"{f.fault.id}: {f.fault.origin}" for f in diagnosis.findings)
    rows = [
        ("Judged", [amount]),
        ("Mode", [mode]),
        ("Truth", [truth.name] if truth else ["not given; --truth FILE.csv compares with it"]),
        ("No residual sees", list(ruleset.unobserved)),
        ("Remarks", list(dict.fromkeys((*diagnosis.notes, *(truth.notes if truth else ()))))),
        ("Pictures", [f"after {paper}"]),
        ("Rules of the findings", list(origins)),
    ]
    left = told_else(diagnosis) if diagnosis.findings else ()
    found: list[Content] = [Facts(rows, "facts")]
    if left:
        found += [Drawing(f"<h3>{UNSEEN}</h3>"), remarks(left, diagnosis.calendar)]
    return found


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
    """Diagnose a recording."""
    found = diagnose(recording, ruleset, mode)
    return Judged(name=name, recording=recording, diagnosis=found, truth=truth)


def judged_results(file: Path, ruleset: Ruleset, mode: str, truth: bool) -> Judged:
    """Diagnose from the results of modules; raises `RecordingRefused` for options that need
    samples."""
    if truth:
        raise RecordingRefused("a truth needs a recording; results of modules have no samples")
    if mode != "default":
        raise RecordingRefused(
            f"--mode {mode} needs a recording: its rules read the sensors themselves"
        )
    found = diagnose_results(read_results(file, ruleset), ruleset)
    return Judged(name=file.resolve().name, recording=None, diagnosis=found)
