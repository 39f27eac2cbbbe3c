"""What disagrees at a point, and a plant that is not as its sheet says from the first sample on.

Nobody has seen such a plant agree with its laws. So what a sheet leaves open explains it at least
as well as a meter that went wrong before anybody looked.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rulec_runtime.contract.threshold import threshold_of
from rulec_runtime.diagnosis.steady.findings import Finding, Found, Period
from rulec_runtime.diagnosis.steady.seen import Seen
from rulec_runtime.diagnosis.steady.verdict import disagreeing
from rulec_runtime.recordings.stationary import Timeline

ADVICE = "calibrate, or ask `rulec mismatch`"


def against_sheet(timeline: Timeline, seen: Seen, found: Found) -> Found:
    """What a part says over a recording. Where it was never calibrated and deviates from the first
    sample to the last, that is told once, and not as faults of meters."""
    judged = np.flatnonzero(seen.isolation.judged)
    if not (seen.combined and len(judged) and (found.findings or found.unknown)):
        return found
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(seen.observed.residuals) / threshold_of(seen.observed.residual_u)
    # Where not every operating point shows it alone, the course over them may tell a meter.
    if _is_calibrated(seen) or not (ratio[:, judged] > 1.0).any(axis=0).all():
        return found
    if any(not f.fault.in_sensor for f in found.findings):
        return replace(found, findings=[_from_the_start(f) for f in found.findings])
    since, until = float(timeline.since[judged[0]]), float(timeline.until[judged[-1]])
    off = disagreeing(seen, int(judged[np.argmax(seen.isolation.misfit[judged])]))
    text = _text(seen, off[0][0], found.findings)
    return replace(found, findings=[], unknown=[Period(since, until, text, off, from_sheet=True)])


def _is_calibrated(seen: Seen) -> bool:
    """Was any of the part's equations fitted to a recording?"""
    ruleset = seen.part.ruleset
    signals = {name for o in ruleset.observers for name in o.signals}
    return any(ruleset.signal_by_id[name].valid_from is not None for name in signals)


def _from_the_start(finding: Finding) -> Finding:
    return replace(finding, text=f"{finding.text}, from the first sample on: {ADVICE}")


def _text(seen: Seen, worst: str, findings: Sequence[Finding]) -> str:
    (residual,) = (r for r in seen.part.ruleset.residuals if r.id == worst)
    text = f"{residual.module} is not as its sheet says, from the first sample on: {ADVICE}"
    if not findings:
        return text
    return f"{text}; only if the sheet is right, {max(findings, key=lambda f: f.probability).text}"
