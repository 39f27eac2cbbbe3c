"""A plant that does not match its sheet, from the first sample on.

Such a plant was never observed to follow its laws, and sheets are wrong by several standard
uncertainties now and then. So if that explains the deviation, no meter is blamed.
"""

from dataclasses import replace

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.findings import Finding, Found, Period
from rulec_runtime.diagnosis.steady.hypothesis import stacked_test
from rulec_runtime.diagnosis.steady.isolate import accepted
from rulec_runtime.diagnosis.steady.observe import slope_names
from rulec_runtime.diagnosis.steady.redundancy import spread_evenly
from rulec_runtime.diagnosis.steady.verdict import disagreeing
from rulec_runtime.recordings.stationary import Timeline

ADVICE = "from the first sample: calibrate, or run `rulec mismatch`"


def against_sheet(timeline: Timeline, evaluated: EvaluatedPoints, found: Found) -> Found:
    """Results of a part over a recording. If it was never calibrated and deviates in every stretch,
    this is reported once, and not as faults of meters only."""
    ruleset, judged = evaluated.part.ruleset, np.flatnonzero(evaluated.isolation.judged)
    if not (evaluated.combined and len(judged) and (found.findings or found.unknown)):
        return found
    first = disagreeing(evaluated, int(judged[0]))
    calibrated = any(ruleset.signal_by_id[n].valid_from is not None for n in ruleset.observed)
    if calibrated or not (first and evaluated.isolation.deviating[judged].all()):
        return found
    if any(_in_the_plant(ruleset, f) for f in found.findings):
        return replace(found, findings=[replace(f, from_sheet=True) for f in found.findings])
    if not _explains(evaluated, judged):
        return found
    since, until = float(timeline.since[judged[0]]), float(timeline.until[judged[-1]])
    off = (
        disagreeing(evaluated, int(judged[np.argmax(evaluated.isolation.misfit[judged])])) or first
    )
    (module,) = (r.module for r in ruleset.residuals if r.id == off[0][0])
    text = f"{module} is not as its sheet says, {ADVICE}"
    if found.findings:
        text += f"; if the sheet is right, {max(found.findings, key=lambda f: f.probability).text}"
    return replace(found, findings=[], unknown=[Period(since, until, text, off, from_sheet=True)])


def _in_the_plant(ruleset: Ruleset, finding: Finding) -> bool:
    names = (finding.fault.id, *(name for name, _ in finding.alternatives))
    return not all(ruleset.fault_by_id[name].in_sensor for name in names)


def _explains(evaluated: EvaluatedPoints, judged: np.ndarray) -> bool:
    """Whether parameters within the error of a sheet leave no contradiction."""
    ruleset, plain = evaluated.part.ruleset, evaluated.plain
    lags = [f"lag:{name}" for name in plain.points.lag]
    errors = sorted({*(name.split(":", 2)[2] for name in slope_names(ruleset)), *lags})
    certain = {*plain.points.u, *lags, *ruleset.misfits}
    factor = np.array([1.0 if name in certain else limits.SHEET_ERROR for name in errors])
    points, valid = spread_evenly(plain.valid, judged)
    wide = replace(plain, shared=plain.shared * factor[:, None])
    test = stacked_test(ruleset, wide, valid, points[:, None], np.ones((len(points), 1)))
    limit = accepted(test.freedom, 0, evaluated.isolation.chance)
    return bool(test.metric.value[0] <= limit)
