"""Evidence of a finding: how far readings are from the prediction of the balances.

From the last window without a deviation the balances are simulated into the first one that is
faulty from beginning to end; there their prediction is compared with the readings.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.threshold import sign_of, threshold_of
from rulec_runtime.diagnosis.steady.evidence import Evidence, Latest
from rulec_runtime.diagnosis.steady.isolate import alarm_chance, quantile
from rulec_runtime.diagnosis.steady.redundancy import chi_square_limit
from rulec_runtime.diagnosis.stores.joined_windows import Cause, Spell, windows_needed
from rulec_runtime.diagnosis.stores.judge_windows import Judge, Judged
from rulec_runtime.diagnosis.stores.window_fit import Guess, Model
from rulec_runtime.diagnosis.stores.windows import Window, Windows
from rulec_runtime.simulation.balances import RanAway


def evidence_of(
    model: Model, windows: Windows, judged: Sequence[Judged], spell: Spell, cause: Cause
) -> tuple[Evidence, ...]:
    """One entry per reading that balances predict."""
    target = judged[spell.first + min(2, spell.last - spell.first - 1)]
    before = judged[spell.first - 1] if spell.first else target
    calm = before.plain is not None and not before.deviating
    reference = before if calm and before.window.piece == target.window.piece else target
    assert reference.plain is not None
    window = windows.joined(reference.window, target.window)
    rows = window.time >= target.window.time[0]
    known = reference.plain.guess
    # Without a window before, only the part with the largest misfit is evidence.
    guess = Guess(known.starts, known.errors, np.zeros(1))
    try:
        shown, slopes, _ = model.simulate(window, guess, (cause.fault,))
    except RanAway:
        return ()
    if reference is target:
        rows = _worst(model, window, shown)
    return tuple(_entries(model, window, shown, slopes, rows, reference, cause))


def latest_of(judge: Judge, judged: Sequence[Judged]) -> Latest | None:
    """Residual of each reading with the balances without a fault, as its root mean square, beside
    the value at which this reading alone makes a window deviate; None if no window could be
    simulated.

    A finding needs some windows in a row, so the window with the best fit among as many last ones
    counts: none is beyond its threshold while nothing is reported.
    """
    there = [i for i, one in enumerate(judged) if one.plain is not None]
    if not there:
        return None
    last = judged[there[-1]].window
    of_piece = [judged[i] for i in there if judged[i].window.piece == last.piece]
    latest = of_piece[-windows_needed(judged, there[-1]) :]
    chance = quantile(alarm_chance(len(judged)) / 2)
    entries = []
    for i, name in enumerate(judge.model.dynamics.outputs):
        found = [one for one in (_left(judge, one, i, chance) for one in latest) if one]
        value, u = min(found, key=lambda one: one[0] / one[1], default=(0.0, 0.0))
        verdict = sign_of(value, u) if found else "invalid"
        entries.append(Evidence(name, value, u, 0.0, threshold_of(u), verdict, "0"))
    return Latest(float(latest[0].window.time[0]), float(last.time[-1]), tuple(entries))


def _left(judge: Judge, one: Judged, output: int, chance: float) -> tuple[float, float] | None:
    """Root mean square that a window leaves of an output, and the uncertainty at which it alone
    would make the window deviate; None without a reading."""
    assert one.plain is not None
    error = one.plain.error[:, output]
    error = error[np.isfinite(error)]
    if not len(error):
        return None
    limit = chi_square_limit(one.freedom, chance) / len(error)
    u = float(judge.model.spread[output] * np.sqrt(limit)) / threshold_of(1.0)
    return float(np.sqrt(np.mean(error**2))), u


def _worst(model: Model, window: Window, shown: Array) -> np.ndarray:
    """The third of a window in which readings are farthest off."""
    count = len(window.time)
    part = np.arange(count) * 3 // count
    off = np.nan_to_num(np.abs(window.measured - shown) / model.spread).sum(axis=1)
    return np.asarray(part == int(np.argmax(np.bincount(part, off))))


def _entries(
    model: Model,
    window: Window,
    shown: Array,
    slopes: Array,
    rows: np.ndarray,
    reference: Judged,
    cause: Cause,
) -> Iterator[Evidence]:
    assert reference.plain is not None
    covariance = reference.plain.covariance
    for i, name in enumerate(model.dynamics.outputs):
        here = rows & np.isfinite(window.measured[:, i])
        if not here.any():
            yield Evidence(name, 0.0, 0.0, 0.0, 0.0, "invalid", "0")
            continue
        value = float(np.mean(window.measured[here, i] - shown[here, i]))
        mean = slopes[here, i].mean(axis=0)
        lasting = float(np.sqrt(max(mean[:-1] @ covariance @ mean[:-1], 0.0)))
        u = float(np.hypot(lasting, model.spread[i] / np.sqrt(here.sum())))
        effect = float(mean[-1] * cause.degree)
        signs = sign_of(value, u), sign_of(effect, u)
        yield Evidence(name, value, u, lasting, threshold_of(u), *signs)
