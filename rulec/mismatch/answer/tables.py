"""Tables of the report: errors of the models, rivals that lost, parameters, doubts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from rulec_runtime.report.document import facts
from rulec_runtime.report.text import number, safe

from rulec.mismatch.answer.wording import (
    confounded_words,
    errors_of,
    evidence_words,
    interval,
    labelled,
    other_fits,
    proof,
    titled,
    value_and_u,
)
from rulec.mismatch.result import Finding, Fit, Mismatch


def proof_table(mismatch: Mismatch, fit: Fit) -> str:
    """Errors of the models on both parts of the recording, with bars for the held-out one."""
    rows = errors_of(fit, mismatch.explained)
    largest = max((kept for _, _, kept in rows if np.isfinite(kept)), default=0.0)
    body = "".join(
        f'<tr><td>{name}</td><td class="num">{number(seen)}</td>'
        f'<td class="num">{number(kept)}</td><td class="wide">{_meter(kept, largest)}</td></tr>'
        for name, seen, kept in rows
    )
    head = _head(("model", False), ("fitted", True), ("held out", True), ("", False))
    key = f"rms error of {fit.signal} in {fit.unit}; bars: on held-out blocks"
    words = proof(fit, mismatch.explained)
    return f'<p class="key">{safe(key)}</p>{_table(head, body)}<p class="after">{safe(words)}</p>'


def other_readings(mismatch: Mismatch) -> str:
    """Held-out errors of the other signals that the models predict."""
    fits, repaired = other_fits(mismatch), mismatch.explained
    if not fits:
        return ""
    body = "".join(
        f"<tr><td>{safe(fit.signal)}</td>"
        + "".join(f'<td class="num">{number(kept)}</td>' for _, _, kept in errors_of(fit, repaired))
        + f"<td>{safe(fit.unit)}</td></tr>"
        for fit in fits
    )
    names = [name for name, _, _ in errors_of(fits[0], repaired)]
    head = _head(("signal", False), *((name, True) for name in names), ("unit", False))
    return f'<h3 class="after">Other readings, held out</h3>{_table(head, body)}'


def _meter(value: float, largest: float) -> str:
    if not (np.isfinite(value) and largest > 0):
        return ""
    return f'<i class="meter" style="width:{100 * value / largest:.1f}%"></i>'


def rivals(mismatch: Mismatch) -> str:
    """Per finding its own gain and that of the rivals it beat."""
    findings = [f for f in mismatch.findings if f.rivals]
    if not findings:
        return ""
    body = "".join(row for finding in findings for row in _rivals_of(finding))
    head = _head(("explanation", False), ("gain in log likelihood", True), ("", False))
    key = "rivals must lose, on blocks to which nothing was fitted"
    return f'<h3 class="after">Rivals</h3><p class="key">{key}</p>{_table(head, body)}'


def _rivals_of(finding: Finding) -> Iterator[str]:
    rows = [(titled(finding), finding.gain, "found")]
    rows += [(rival.title, rival.gain, "lost") for rival in finding.rivals]
    for title, gain, outcome in rows:
        shown = f"<b>{safe(title)}</b>" if outcome == "found" else safe(title)
        yield f'<tr><td>{shown}</td><td class="num">{number(gain)}</td><td>{outcome}</td></tr>'


def parameters(mismatch: Mismatch) -> str:
    """Every parameter that a finding brings in, with its uncertainty."""
    body = "".join(
        f"<tr><td>{safe(label)}</td>"
        f'<td class="num">{value_and_u(e)[0]}</td><td class="num">{value_and_u(e)[1]}</td>'
        f'<td class="num">{interval(e)}</td><td>{safe("" if e.unit == "1" else e.unit)}</td></tr>'
        for finding in mismatch.findings
        for label, e in labelled(finding)
    )
    if not body:
        return ""
    head = _head(
        ("parameter", False),
        ("value", True),
        ("u", True),
        ("95 % interval", True),
        ("unit", False),
    )
    return _table(head, body)


def doubts(mismatch: Mismatch) -> str:
    """Parameters that cannot be told apart, and where the model was never tested."""
    rows = [
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
    body = "".join(
        f'<tr><td class="num">{part.rows}</td><td>{"used" if part.used else "not used"}</td>'
        f"<td>{safe(part.because)}</td></tr>"
        for part in mismatch.evidence
    )
    head = _head(("rows", True), ("", False), ("for, or because", False))
    return f"<p>{safe(evidence_words(mismatch))}.</p>{_table(head, body)}"


def _head(*columns: tuple[str, bool]) -> str:
    return "".join(
        f'<th class="num">{title}</th>' if right else f"<th>{title}</th>"
        for title, right in columns
    )


def _table(head: str, body: str) -> str:
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )
