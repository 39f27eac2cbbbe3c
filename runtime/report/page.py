"""The report: one HTML file that needs nothing else, neither network nor scripts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from runtime.diagnose import Diagnosis
from runtime.recording import Recording
from runtime.report.chart import SYMBOLS
from runtime.report.figure import Figure
from runtime.report.figures import figures_of
from runtime.report.matrix import matrix
from runtime.report.series import curves_of
from runtime.report.story import UNSEEN, evidence, remarks, told
from runtime.report.style import STYLE
from runtime.report.text import counted, moment, percent, safe
from runtime.report.truth import Truth, cases_of
from runtime.trace import Trace

POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""Forbids the browser to load anything, should a name ever slip through unescaped."""


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
    curves = curves_of(recording, diagnosis, trace)
    figures = figures_of(diagnosis, curves, trace, truth, cases)
    because = "".join(evidence(diagnosis)) or _nothing(diagnosis)
    sections = [
        told(diagnosis),
        _section("Why", because),
        _section("Pictures", "".join(_numbered(figures))),
        _section("What each fault would do", matrix(diagnosis)),
        _section("Where this comes from", _facts(recording, diagnosis, name, truth)),
    ]
    return _document(diagnosis, name, "".join(sections))


def _document(diagnosis: Diagnosis, name: str, body: str) -> str:
    title = safe(diagnosis.ruleset.title)
    shapes = "".join(
        f'<symbol id="{k}" overflow="visible">{v}</symbol>' for k, v in SYMBOLS.items()
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"/>'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}"/>'
        '<meta name="viewport" content="width=device-width, initial-scale=1"/>'
        f"<title>{safe(name)}: diagnosis</title><style>{STYLE}</style></head>\n<body>"
        f'<svg class="symbols" aria-hidden="true">{shapes}</svg>'
        f'<header><h1>{title}</h1><span class="soft">{safe(name)}</span></header>\n'
        f"<main>{body}</main></body></html>\n"
    )


def _section(title: str, body: str) -> str:
    return f"<section><h2>{title}</h2>{body}</section>\n"


def _nothing(diagnosis: Diagnosis) -> str:
    """What stands in the place of evidence when there is no finding."""
    if not diagnosis.judged:
        return "<p>Nothing could be judged; the reasons are above.</p>"
    if diagnosis.unknown:
        return "<p>The pictures show which estimates disagree; no known fault explains how.</p>"
    return (
        "<p>All estimates of the same flow agree within their uncertainty wherever the recording "
        "could be judged.</p>"
    )


def _numbered(figures: Iterable[Figure]) -> Iterator[str]:
    for i, figure in enumerate(figures, 1):
        style = " ".join(
            word for word, on in (("narrow", figure.narrow), ("tall", figure.tall)) if on
        )
        key = f'<p class="key">{safe(figure.key)}</p>' if figure.key else ""
        yield (
            f'<figure id="{figure.name}" class="{style}"><h3>{safe(figure.title)}</h3>{key}'
            f"{figure.body}<figcaption><b>Figure {i}.</b> {safe(figure.caption)}</figcaption>"
            "</figure>\n"
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
            [f"{counted(diagnosis.judged, 'sample')} ({percent(share)}) in settled stretches"],
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
    body = "".join(
        f"<dt>{term}</dt>" + "".join(f"<dd>{safe(text)}</dd>" for text in texts)
        for term, texts in rows
        if texts
    )
    unjudged = ""
    if diagnosis.not_judged and diagnosis.findings:
        unjudged = f"<h3>{UNSEEN}</h3>{remarks(diagnosis.not_judged)}"
    return f'<div class="facts"><dl>{body}</dl>{unjudged}</div>'


def _origins(diagnosis: Diagnosis) -> list[str]:
    """Where the faults that were found are written down."""
    return list(dict.fromkeys(f"{f.fault.id}: {f.fault.origin}" for f in diagnosis.findings))
