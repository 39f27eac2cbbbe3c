"""Evidence of a finding: how far readings are from the prediction of the balances.

From the last window without a deviation the balances are simulated into the first one that is
faulty from beginning to end; there their prediction is compared with the readings.
"""

import numpy as np

from rulec_runtime.contract.threshold import sign_of, threshold_of
from rulec_runtime.diagnosis.steady.evidence import Evidence, Latest
from rulec_runtime.diagnosis.steady.isolate import alarm_chance, quantile
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit
from rulec_runtime.diagnosis.stores.joined_windows import Cause, Run, windows_needed
from rulec_runtime.diagnosis.stores.judge_windows import Judged, Weighed
from rulec_runtime.simulation.balances import RanAway


def evidence_of(found: Weighed, run: Run, cause: Cause | None) -> tuple[Evidence, ...]:
    """One entry per reading that balances predict; without a cause none is expected to deviate."""
    model, members = found.model, run.members
    target = found.judged[members[min(2, len(members) - 1)]]
    before = found.judged[members[0] - 1] if members[0] else target
    calm = before.plain is not None and not before.deviating
    reference = before if calm and before.window.piece == target.window.piece else target
    assert reference.plain is not None
    window = found.windows.joined(reference.window, target.window)
    window = model.with_forms(window, reference.plain.unknowns)
    faults, degree = ((cause.fault,), cause.degree) if cause else ((), 0.0)
    known = len(reference.plain.unknowns)
    try:
        unknowns = np.append(reference.plain.unknowns, np.zeros(len(faults)))
        shown, slopes, _ = model.simulate(window, unknowns, faults)
    except RanAway:
        return ()
    rows, off = window.time >= target.window.time[0], window.measured - shown
    if reference is target:
        # Without a window before, only the third with the largest misfit is evidence.
        part = np.arange(len(rows)) * 3 // len(rows)
        size = np.nan_to_num(np.abs(off) / model.spread).sum(axis=1)
        rows = part == int(np.argmax(np.bincount(part, size)))
    covariance, entries = reference.plain.covariance, []
    for i, name in enumerate(model.dynamics.outputs):
        here = rows & np.isfinite(off[:, i])
        if not here.any():
            entries.append(Evidence(name, 0.0, 0.0, 0.0, 0.0, "invalid", "0"))
            continue
        value, mean = float(np.mean(off[here, i])), slopes[here, i].mean(axis=0)
        lasting = float(np.sqrt(max(mean[:known] @ covariance @ mean[:known], 0.0)))
        u = float(np.hypot(lasting, model.spread[i] / np.sqrt(here.sum())))
        signs = sign_of(value, u), sign_of(float(mean[known:].sum() * degree), u)
        entries.append(Evidence(name, value, u, lasting, threshold_of(u), *signs))
    return tuple(entries)


def latest_of(found: Weighed) -> Latest | None:
    """Residual of each reading with the balances without a fault, as its root mean square, beside
    the value at which this reading alone makes a window deviate; None if no window could be
    simulated.

    A finding needs some windows in a row, so the window with the best fit among as many last ones
    counts: none is beyond its threshold while nothing is reported.
    """
    there = [i for i, one in enumerate(found.judged) if one.plain is not None]
    if not there:
        return None
    last = found.judged[there[-1]].window
    of_piece = [
        one for one in map(found.judged.__getitem__, there) if one.window.piece == last.piece
    ]
    latest = of_piece[-windows_needed(found.judged, there[-1]) :]
    entries = []
    for i, name in enumerate(found.model.dynamics.outputs):
        left = [own for own in (_left(found, one, i) for one in latest) if own]
        value, u = min(left, key=lambda own: own[0] / own[1], default=(0.0, 0.0))
        verdict = sign_of(value, u) if left else "invalid"
        entries.append(Evidence(name, value, u, 0.0, threshold_of(u), verdict, "0"))
    return Latest(float(latest[0].window.time[0]), float(last.time[-1]), tuple(entries))


def _left(found: Weighed, one: Judged, output: int) -> tuple[float, float] | None:
    """Root mean square that a window leaves of an output, and the uncertainty at which it alone
    would make the window deviate; None without a reading. Errors that had to move beyond what is
    known of them count as if they were left."""
    assert one.plain is not None
    left = float(np.nansum((one.plain.error / found.model.spread) ** 2))
    error = one.plain.error[:, output] * np.sqrt(one.chi / (left or np.inf))
    error = error[np.isfinite(error)]
    if not len(error):
        return None
    chance = quantile(alarm_chance(len(found.judged)) / 2)
    limit = chi_square_limit(one.freedom, chance) / len(error)
    u = float(found.model.spread[output] * np.sqrt(limit)) / threshold_of(1.0)
    return float(np.sqrt(np.mean(error**2))), u
