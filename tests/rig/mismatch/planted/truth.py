"""The model with the truth in it, judged as any other: what could have been found at best."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit, variance_inflation_of
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.evidence.steady.screen import references
from rulec.mismatch.search.compete import CrossValidated, contest
from rulec.mismatch.search.weigh import net_gain
from tests.rig.mismatch.planted.build import Built


def true_model(plain: CrossValidated, built: Built) -> CrossValidated:
    """The model with the truth in it, refitted from the true values, judged as any other."""
    rows: Rows = plain.fitted.rows
    setting = Configuration(values=plain.fitted.setting.values)
    for candidate in built.joined:
        own = {u.id: built.values[u.id] for u in candidate.unknowns if not u.fixed}
        setting = setting.joining(candidate, own, references(rows.system, candidate))
    freed = {m for c in built.joined if c.sort in ("physics", "ageing") for m in c.modules}
    setting = replace(setting, released=frozenset(freed))
    return contest(_refitted(plain.fitted, setting), None)


def released(plain: CrossValidated, true: CrossValidated) -> CrossValidated:
    """The plain model with the calibration of the modules of the truth let go."""
    setting = replace(plain.fitted.setting, released=true.fitted.setting.released)
    return contest(_refitted(plain.fitted, setting), None)


def _refitted(was: Fitted, setting: Configuration) -> Fitted:
    """Refitted twice, the second time with neighbours counted as what they are worth."""
    first = fit(was.rows, setting, was.used, variance_inflation=was.variance_inflation)
    return fit(was.rows, first.setting, was.used, variance_inflation=variance_inflation_of(first))


def net(one: CrossValidated, other: CrossValidated) -> float:
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
