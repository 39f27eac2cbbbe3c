"""A plant that does not match its sheet, from the first sample on.

Such a plant was never observed to follow its laws, and sheets are wrong by several standard
uncertainties now and then. So if that explains the deviation, no meter is blamed.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rulec_runtime.contract.ruleset import FORM, MISFIT, Ruleset
from rulec_runtime.diagnosis.steady import limits
from rulec_runtime.diagnosis.steady.baseline import times_of
from rulec_runtime.diagnosis.steady.degree_course import stack_of
from rulec_runtime.diagnosis.steady.evaluated_points import EvaluatedPoints
from rulec_runtime.diagnosis.steady.findings import Finding, Found, Period
from rulec_runtime.diagnosis.steady.hypothesis import HypothesisTest, stacked_test
from rulec_runtime.diagnosis.steady.isolate import accepted
from rulec_runtime.diagnosis.steady.observe import Observed
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
    off = disagreeing(evaluated, int(judged[np.argmax(evaluated.isolation.misfit[judged])]))
    calibrated = any(ruleset.signal_by_id[n].valid_from is not None for n in ruleset.observed)
    if calibrated or not off:
        return found
    always = bool(evaluated.isolation.deviating[judged].all())
    if any(_in_the_plant(ruleset, f) for f in found.findings):
        findings = [replace(f, from_sheet=always) for f in found.findings]
        return replace(found, findings=findings)
    if not _explains(evaluated, judged, found.findings, always):
        return found
    since, until = float(timeline.since[judged[0]]), float(timeline.until[judged[-1]])
    (module,) = (r.module for r in ruleset.residuals if r.id == off[0][0])
    text = f"{module} is not as its sheet says, {ADVICE}"
    if found.findings:
        text += f"; if the sheet is right, {max(found.findings, key=lambda f: f.probability).text}"
    return replace(found, findings=[], unknown=[Period(since, until, text, off, from_sheet=True)])


def _in_the_plant(ruleset: Ruleset, finding: Finding) -> bool:
    names = (finding.fault.id, *(name for name, _ in finding.alternatives))
    return not all(ruleset.fault_by_id[name].in_sensor for name in names)


def _explains(
    evaluated: EvaluatedPoints, judged: np.ndarray, findings: Sequence[Finding], always: bool
) -> bool:
    """Whether laws within the error of a sheet, in their parameters or their form, explain all
    stretches, and do so better than faults that begin and grow. Of few stretches, or where nothing
    is named, all have to deviate `always`."""
    ruleset, plain = evaluated.part.ruleset, evaluated.plain
    points, valid = spread_evenly(plain.valid, judged)
    wide = _wide(ruleset, plain, points, limits.SHEET_ERROR)
    test = stacked_test(ruleset, wide, valid, points[:, None], np.ones((len(points), 1)))
    if test.metric.value[0] > accepted(test.freedom, 0, evaluated.isolation.chance):
        return False
    own = [i for i, fault in enumerate(ruleset.faults) for f in findings if f.fault.id == fault.id]
    stack = stack_of(ruleset, plain, judged, float(times_of(plain)[judged[-1]]), own)
    if stack is None or not own:
        return always
    courses = [stack.course(i, ended=ended) for i in own for ended in stack.ends()]
    # What was there from the first stretch to the last may as well be the sheet's.
    begun = [c for c in courses if c and (c.onset or c.ended < len(stack.time))]
    gains = [c.gain + np.log(ruleset.odds[c.fault] / ruleset.odds.sum()) for c in begun]
    sheet = []
    for size, chance in limits.OFF_SHEET:
        wide = _wide(ruleset, plain, stack.points, size)
        test = replace(stack.test, observed=wide, computed=None, error_cache={})
        sheet.append(_log_density(test) + np.log(chance))
    return bool(max(sheet) - _log_density(stack.test) > max(gains, default=-np.inf))


def _log_density(test: HypothesisTest) -> float:
    """Logarithm of the density of the residuals of a test with one problem, up to a constant."""
    covariance, residuals = test.covariance()[0], test.residuals[0]
    left = float(residuals @ np.linalg.solve(covariance, residuals))
    return -0.5 * (left + float(np.linalg.slogdet(covariance)[1]))


def _wide(ruleset: Ruleset, plain: Observed, points: np.ndarray, size: float) -> Observed:
    """Estimates whose parameters and forms of laws may be `size` standard uncertainties off. A form
    then follows the readings of an estimate smoothly: by a line and a parabola over their span."""
    lags = (f"lag:{name}" for name in plain.points.lag)
    certain = {*plain.points.u, *lags, *(name for name in plain.errors if name.endswith(MISFIT))}
    factor = np.array([1.0 if name in certain else size for name in plain.errors])
    shared = plain.shared * factor[:, None]
    forms = shared[:, [name.endswith(FORM) for name in plain.errors]]
    wide = [shared]
    for name in sorted(plain.points.values.keys() & plain.points.u.keys()):
        reading = plain.points.values[name]
        span = np.ptp(reading[points])
        if span > limits.SPAN_OF_A_FORM * np.max(plain.points.u[name][points], initial=0.0):
            module = name.partition(".")[0]
            reads = np.array([name in o.signals or o.module == module for o in ruleset.observers])
            own = np.where(reads[:, None, None], forms, 0.0)
            place = 2.0 * (reading - reading[points].mean()) / span
            wide += [own * place, own * place**2]
    return replace(plain, shared=np.concatenate(wide, axis=1))
