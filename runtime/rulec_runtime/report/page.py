"""Assemble the report of a diagnosis: findings, evidence, pictures, matrix, origin."""

from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.verdict_per_sample import Trace
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.report.blindness import not_judged
from rulec_runtime.report.chart import figures_html
from rulec_runtime.report.document import Head, badge, document
from rulec_runtime.report.figures import figures_of
from rulec_runtime.report.html_findings import UNSEEN, evidence, findings_parts, remarks
from rulec_runtime.report.matrix import matrix
from rulec_runtime.report.parts import Content, Facts, Part, Words
from rulec_runtime.report.series import curves_of
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.text import Html, counted, percent
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
    parts = [*findings_parts(diagnosis), Part("Why", why or [Words(_nothing(diagnosis))])]
    figures = [*figures_of(diagnosis, curves, trace, truth, cases)]
    if figures:
        parts.append(Part("Pictures", [figures_html(figures)]))
    if ruleset.residuals:
        parts.append(Part("What each fault would do", matrix(diagnosis)))
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
    left = not_judged(diagnosis) if diagnosis.findings else ()
    found: list[Content] = [Facts(rows, "facts")]
    if left:
        found += [Html(f"<h3>{UNSEEN}</h3>"), remarks(left, diagnosis.calendar)]
    return found
