"""The report of a diagnosis: what is wrong, why, pictures, the matrix, where it comes from."""

from __future__ import annotations

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.traced import Trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.document import document, facts, numbered, section
from rulec_runtime.report.figures import figures_of
from rulec_runtime.report.html_story import UNSEEN, evidence, remarks, told
from rulec_runtime.report.matrix import matrix
from rulec_runtime.report.series import curves_of
from rulec_runtime.report.text import counted, moment, percent
from rulec_runtime.report.truth import Truth, cases_of
from rulec_runtime.report.wording import part_judged


def report(
    recording: Recording,
    diagnosis: Diagnosis,
    trace: Trace,
    name: str,
    truth: Truth | None = None,
) -> str:
    """Write a report; the same input gives the same text.

    Parameters
    ----------
    trace : of the same recording, ruleset and mode as the diagnosis.
    name : of the recording, as its reader knows it.
    truth : what was truly wrong; without it there is nothing to compare with.
    """
    cases = cases_of(truth, trace, diagnosis.ruleset) if truth is not None else None
    curves = curves_of(examine(recording, diagnosis.ruleset).recording, diagnosis, trace)
    figures = figures_of(diagnosis, curves, trace, truth, cases)
    because = "".join(evidence(diagnosis)) or _nothing(diagnosis)
    sections = [
        told(diagnosis),
        section("Why", because),
        section("Pictures", "".join(numbered(figures))),
        section("What each fault would do", matrix(diagnosis)),
        section("Where this comes from", _facts(recording, diagnosis, name, truth)),
    ]
    return document(diagnosis.ruleset.title, name, "diagnosis", "".join(sections))


def _nothing(diagnosis: Diagnosis) -> str:
    """What stands in the place of evidence when there is no finding."""
    if not diagnosis.judged:
        return "<p>Nothing could be judged; the reasons are above.</p>"
    if diagnosis.unknown:
        return "<p>The pictures show which estimates disagree; no known fault explains how.</p>"
    if diagnosis.ruleset.dynamics is not None:
        return "<p>All readings are as the balances predict, wherever they could be judged.</p>"
    return (
        "<p>All estimates of the same flow agree within their uncertainty wherever the recording "
        "could be judged.</p>"
    )


def _facts(recording: Recording, diagnosis: Diagnosis, name: str, truth: Truth | None) -> str:
    """Plant, ruleset, recording, mode, what was not judged and why, remarks of the reader."""
    ruleset = diagnosis.ruleset
    share = diagnosis.judged / max(diagnosis.samples, 1)
    start, end = moment(float(recording.time[0])), moment(float(recording.time[-1]))
    mode = {
        "default": "default: the whole residual vector with its uncertainties",
        "paper": "paper: Eqs. 17 to 19 of Wetterich, Kuhr, Pelz 2025 as printed",
    }[diagnosis.mode]
    rows = [
        ("Plant", [f"{ruleset.plant}: {ruleset.title}"]),
        ("Ruleset", [f"made of sources with the hash {ruleset.sources}"]),
        (
            "Recording",
            [f"{name}, {counted(diagnosis.samples, 'sample')} from {start} s to {end} s"],
        ),
        (
            "Judged",
            [f"{counted(diagnosis.judged, 'sample')} ({percent(share)}) {part_judged(ruleset)}"],
        ),
        ("Mode", [mode]),
        ("Truth", [truth.name] if truth else ["not given; --truth FILE.csv compares with it"]),
        ("No residual sees", list(ruleset.unobserved)),
        ("Remarks", list(dict.fromkeys((*diagnosis.notes, *(truth.notes if truth else ()))))),
        (
            "Pictures",
            ["after Figures 7 to 11 of Wetterich, Kuhr, Pelz, Processes 2025, 13(10), 3293"],
        ),
        ("Rules of the findings", _origins(diagnosis)),
    ]
    unjudged = ""
    if diagnosis.not_judged and diagnosis.findings:
        unjudged = f"<h3>{UNSEEN}</h3>{remarks(diagnosis.not_judged, diagnosis.calendar)}"
    return f'<div class="facts">{facts(rows)}{unjudged}</div>'


def _origins(diagnosis: Diagnosis) -> list[str]:
    """Where the faults that were found are written down."""
    return list(dict.fromkeys(f"{f.fault.id}: {f.fault.origin}" for f in diagnosis.findings))
