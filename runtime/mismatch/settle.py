"""The repaired model as it will be used: with sensors as they are, and what it may be trusted for.

In the search each sensor may err within its class. Whoever uses the model later reads the same
sensors: their errors belong into the parameters then, as in any calibration on site.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from runtime.mismatch.fit import Fitted, fit
from runtime.mismatch.result import Changed
from runtime.mismatch.setting import ERROR, Setting
from runtime.plan import Array

FAR = 5.0
"""Robust standard deviations beyond which a point is set aside, as in calibration."""

REPAIRING = ("physics", "ageing")
"""Sorts of explanations that become part of a model."""


@dataclass(frozen=True)
class Repair:
    """Values of a repaired model, SI.

    `parameters` with their joint `covariance`, shape (parameters, parameters), those of joined
    candidates behind base parameters; `fixed` references of joined candidates; `misfit` what is
    left per observer, m3/s; `ranges` per signal the readings it was fitted to.
    """

    parameters: tuple[Changed, ...]
    covariance: Array
    fixed: Mapping[str, float]
    misfit: Mapping[str, float]
    ranges: Mapping[str, tuple[float, float]]


def with_sensors_as_they_are(fitted: Fitted, setting: Setting | None = None) -> Fitted:
    """Refit a setting (that of the fit unless given) with no error of any sensor.

    Terms without physics behind them are left out: nobody should rely on them.
    """
    setting = fitted.setting if setting is None else setting
    for candidate in setting.joined:
        if candidate.sort == "free":
            setting = setting.leaving(candidate.id)
    none = {ERROR + name: 0.0 for name in fitted.rows.system.shared}
    return fit(fitted.rows, setting, fitted.used, held=none, temper=fitted.temper)


def repair_of(settled: Fitted) -> Repair:
    """What to write into a plant of the repaired model."""
    setting, system = settled.setting, settled.rows.system
    repairing = [c for c in setting.joined if c.sort in REPAIRING]
    touched = {m for c in repairing for m in c.modules}
    unknowns = {u.id for c in repairing for u in c.unknowns if not u.fixed}
    base = set(system.workshop.parameters.ids)
    names = [
        n
        for n in settled.prior.names
        if n in unknowns or (n in base and n.partition(".")[0] in touched)
    ]
    places = [settled.prior.names.index(n) for n in names]
    return Repair(
        tuple(Changed(n, float(setting.values[n]), settled.u(n)) for n in names),
        settled.covariance[np.ix_(places, places)],
        {u.id: setting.fixed[u.id] for c in repairing for u in c.unknowns if u.fixed},
        _misfit(settled, touched),
        _ranges(settled, touched),
    )


def _misfit(settled: Fitted, touched: set[str]) -> dict[str, float]:
    """What two estimates of a flow still differ by, noise of the readings included, as calibration
    counts it.

    It is the fault of the one that has a misfit at all, or of both alike. Points far off belong to
    something else and are set aside.
    """
    system = settled.rows.system
    flows = system.flows(settled.setting)
    found: dict[str, float] = {}
    for spec in system.ruleset.residuals:
        ids = [t.observer for t in spec.terms]
        if spec.module not in touched or len(ids) != 2 or not all(o in system.number for o in ids):
            continue
        first, second = (system.number[o] for o in ids)
        difference = flows.values[first] - flows.values[second]
        usable = settled.used & system.valid[first] & system.valid[second]
        off = difference[usable & np.isfinite(difference)]
        if not len(off):
            continue
        spread = 1.4826 * float(np.median(np.abs(off - np.median(off))))
        near = off[np.abs(off - np.median(off)) <= FAR * max(spread, 1e-300)]
        own = [o for o in ids if system.ruleset.observer_by_id[o].misfit > 0] or ids
        for name in own:
            value = float(np.sqrt(np.mean(near**2) / len(own)))
            found[name] = max(found.get(name, 0.0), value)
    return found


def _ranges(settled: Fitted, touched: set[str]) -> dict[str, tuple[float, float]]:
    """Readings that the repaired laws have seen, for the signals they speak of."""
    system, setting = settled.rows.system, settled.setting
    drivers = {d for c in setting.joined if c.sort in REPAIRING for d in c.drivers.values()}
    read = {s for o in system.observers if o.module in touched for s in o.signals}
    found = {}
    for name in sorted((read | drivers) & set(system.data.values)):
        values = system.data.values[name][settled.used]
        values = values[np.isfinite(values)]
        if len(values):
            found[name] = (float(values.min()), float(values.max()))
    return found


def plain_of(setting: Setting) -> Setting:
    """The plain model to compare with; faults that come and go are no part of any model."""
    for candidate in setting.joined:
        if not setting.in_periods & {u.id for u in candidate.unknowns}:
            setting = setting.leaving(candidate.id)
    return setting.calibrated()
