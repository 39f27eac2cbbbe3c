"""Tables of the report: errors of the models, rivals that lost, parameters, doubts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rulec_runtime.report.document import facts
from rulec_runtime.report.tables import Column, columns, table
from rulec_runtime.report.text import number, safe

from rulec.mismatch.answer.wording import (
    confounded_words,
    errors_of,
    evidence_words,
    interval,
    is_repaired,
    labelled,
    other_fits,
    proof,
    titled,
    value_and_u,
)
from rulec.mismatch.result import Finding, Fit, Mismatch


def proof_table(mismatch: Mismatch, fit: Fit) -> str:
    """Errors of the models on both parts of the recording, with bars for the held-out one."""
    rows = errors_of(fit, is_repaired(mismatch))
    largest = max((kept for _, _, kept in rows if np.isfinite(kept)), default=0.0)
    key = f"rms error of {fit.signal} in {fit.unit}; bars: on held-out blocks"
    shown = table(
        key,
        [*columns("model", ".fitted", ".held out"), Column("", "wide")],
        ((name, number(seen), number(kept), _meter(kept, largest)) for name, seen, kept in rows),
    )
    words = proof(mismatch, fit)
    return f'<p class="key">{safe(key)}</p>{shown}<p class="after">{safe(words)}</p>'


def other_readings(mismatch: Mismatch) -> str:
    """Held-out errors of the other signals that the models predict."""
    fits, repaired = other_fits(mismatch), is_repaired(mismatch)
    if not fits:
        return ""
    rows = (
        (
            safe(fit.signal),
            *(number(kept) for _, _, kept in errors_of(fit, repaired)),
            safe(fit.unit),
        )
        for fit in fits
    )
    title = "Other readings, held out"
    names = [f".{name}" for name, _, _ in errors_of(fits[0], repaired)]
    return f'<h3 class="after">{title}</h3>{table(title, columns("signal", *names, "unit"), rows)}'


def _meter(value: float, largest: float) -> str:
    if not (np.isfinite(value) and largest > 0):
        return ""
    return f'<i class="meter" style="width:{100 * value / largest:.1f}%"></i>'


def rivals(mismatch: Mismatch) -> str:
    """Per finding its own gain and that of the rivals it beat."""
    findings = [f for f in mismatch.findings if f.rivals]
    if not findings:
        return ""
    rows = (row for finding in findings for row in _rivals_of(finding))
    of = columns("explanation", ".gain in log likelihood", "")
    key = "rivals must lose, on blocks to which nothing was fitted"
    return f'<h3 class="after">Rivals</h3><p class="key">{key}</p>{table("rivals", of, rows)}'


def _rivals_of(finding: Finding) -> Iterator[tuple[str, str, str]]:
    rows = [(titled(finding), finding.gain, "found")]
    rows += [(rival.title, rival.gain, "lost") for rival in finding.rivals]
    for title, gain, outcome in rows:
        shown = f"<b>{safe(title)}</b>" if outcome == "found" else safe(title)
        yield shown, number(gain), outcome


def parameters(mismatch: Mismatch) -> str:
    """Every parameter that a finding brings in, with its uncertainty."""
    rows = [
        (safe(label), *value_and_u(e), interval(e), safe("" if e.unit == "1" else e.unit))
        for finding in mismatch.findings
        for label, e in labelled(finding)
    ]
    of = columns("parameter", ".value", ".u", ".95 % interval", "unit")
    return table("parameters", of, rows) if rows else ""


def doubts(mismatch: Mismatch) -> str:
    """Parameters far from their sheets or not told apart, and where the model was never tested."""
    rows = [
        ("Strained", list(map(str, mismatch.strain))),
        ("Confounded", [confounded_words(pair) for pair in mismatch.confounded]),
        ("Never tested", list(mismatch.untested)),
    ]
    if not any(texts for _, texts in rows):
        return ""
    return f'<div class="facts">{facts(rows)}</div>'


def rows_used(mismatch: Mismatch) -> str:
    """What the rows of the recording served for, and why others were not used; all of them."""
    if not mismatch.evidence:
        return ""
    rows = (
        (safe(part.because), str(part.rows), "used" if part.used else "not used")
        for part in mismatch.evidence
    )
    of = columns("for, or because", ".rows", "")
    return f"<p>{safe(evidence_words(mismatch))}.</p>{table('rows used', of, rows)}"
