"""The report of a diagnosis: what is wrong, why, pictures, the matrix, where it comes from."""

from __future__ import annotations

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.judge import examine
from rulec_runtime.diagnosis.steady.traced import Trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.blindness import told_else
from rulec_runtime.report.document import Head, document, facts, numbered, section
from rulec_runtime.report.figures import figures_of
from rulec_runtime.report.html_story import UNSEEN, badge, evidence, remarks, told
from rulec_runtime.report.made import Made
from rulec_runtime.report.matrix import matrix
from rulec_runtime.report.series import curves_of
from rulec_runtime.report.sketch import sketch
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import counted, percent
from rulec_runtime.report.truth import Truth, cases_of
from rulec_runtime.report.verdict import marks, meaning, verdict
from rulec_runtime.report.wording import part_judged


def report(
    recording: Recording,
    diagnosis: Diagnosis,
    trace: Trace,
    name: str,
    truth: Truth | None = None,
    made: Made | None = None,
) -> str:
    """Write a report; the same input gives the same text.

    Parameters
    ----------
    trace : of the same recording, ruleset and mode as the diagnosis.
    name : of the recording, as its reader knows it.
    truth : what was truly wrong; without it there is nothing to compare with.
    made : when and by what; left out without.
    """
    cases = cases_of(truth, trace) if truth is not None else None
    curves = curves_of(examine(recording, diagnosis.ruleset).recording, diagnosis, trace)
    figures = figures_of(diagnosis, curves, trace, truth, cases)
    because = "".join(evidence(diagnosis)) or _nothing(diagnosis)
    compared = diagnosis.ruleset.residuals
    sections = [
        told(diagnosis),
        section("Why", because),
        section("Pictures", "".join(numbered(figures))),
        *([section("What each fault would do", matrix(diagnosis))] if compared else []),
        section("Where this comes from", _facts(diagnosis, truth)),
    ]
    head = Head(
        kind="Diagnosis",
        verdict=verdict(diagnosis),
        meaning=meaning(diagnosis),
        badge=badge(diagnosis.status),
        facts=tuple(Subject.of(diagnosis.ruleset, recording, name).facts()),
        made=made,
        sketch=sketch(diagnosis.ruleset, marks(diagnosis)),
    )
    return document(head, "".join(sections))


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


def _facts(diagnosis: Diagnosis, truth: Truth | None) -> str:
    """How much was judged, mode, what was not judged and why, remarks of the reader."""
    ruleset = diagnosis.ruleset
    share = diagnosis.judged / max(diagnosis.samples, 1)
    mode = {
        "default": "default: the whole residual vector with its uncertainties",
        "paper": "paper: Eqs. 17 to 19 of Wetterich, Kuhr, Pelz 2025 as printed",
    }[diagnosis.mode]
    rows = [
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
    left = told_else(diagnosis)
    if left and diagnosis.findings:
        unjudged = f"<h3>{UNSEEN}</h3>{remarks(left, diagnosis.calendar)}"
    return f'<div class="facts">{facts(rows)}{unjudged}</div>'


def _origins(diagnosis: Diagnosis) -> list[str]:
    """Where the faults that were found are written down."""
    return list(dict.fromkeys(f"{f.fault.id}: {f.fault.origin}" for f in diagnosis.findings))
