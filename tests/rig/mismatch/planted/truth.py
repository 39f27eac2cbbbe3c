"""The model with the truth in it, judged as any other: what could have been found at best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec.mismatch.evidence.steady.configuration import ERROR, Setting
from rulec.mismatch.evidence.steady.fit import Fitted, fit, temper_of
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import references
from rulec.mismatch.search.compete import Contestant, contest
from rulec.mismatch.search.weigh import net_gain
from tests.rig.mismatch.planted.build import Built


def true_model(plain: Contestant, built: Built) -> Contestant:
    """The model with the truth in it, refitted from the true values, judged as any other."""
    rows: Rows = plain.fitted.rows
    setting = Setting(values=plain.fitted.setting.values)
    for candidate in built.joined:
        own = {u.id: built.values[u.id] for u in candidate.unknowns if not u.fixed}
        setting = setting.joining(candidate, own, references(rows.system, candidate))
    freed = {m for c in built.joined if c.sort in ("physics", "ageing") for m in c.modules}
    setting = replace(setting, released=frozenset(freed))
    return contest(_refitted(plain.fitted, setting), None)


def released(plain: Contestant, true: Contestant) -> Contestant:
    """The plain model with the calibration of the modules of the truth let go."""
    setting = replace(plain.fitted.setting, released=true.fitted.setting.released)
    return contest(_refitted(plain.fitted, setting), None)


def _refitted(was: Fitted, setting: Setting) -> Fitted:
    """Refitted twice, the second time with neighbours counted as what they are worth."""
    first = fit(was.rows, setting, was.used, temper=was.temper)
    return fit(was.rows, first.setting, was.used, temper=temper_of(first))


def net(one: Contestant, other: Contestant) -> float:
    """Gain less the price of what it has more, and of what it asks of sensors and calibration."""
    return net_gain(one, other) - _strain(one.fitted) + _strain(other.fitted)


def _strain(fitted: Fitted) -> float:
    """How improbable the errors of sensors are, and the values of what was not let go."""
    prior, setting = fitted.prior, fitted.setting
    base = fitted.rows.system.builder.parameters.ids
    kept = [
        i
        for i, name in enumerate(prior.names)
        if name.startswith(ERROR)
        or (name in base and name.partition(".")[0] not in setting.released)
    ]
    off = np.array([setting.values[prior.names[i]] for i in kept]) - prior.mean[kept]
    return 0.5 * float(off @ prior.precision[np.ix_(kept, kept)] @ off)
