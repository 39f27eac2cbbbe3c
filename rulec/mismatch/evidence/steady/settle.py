"""The repaired model for use: without lasting sensor errors, and with its range of validity.

In the search each sensor may err within its class. Users of the model read the same sensors, so
their lasting errors belong into the parameters, as in any calibration on site. Errors of single
recordings do not.
"""

from __future__ import annotations

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.limits import NORMAL_SPREAD

from rulec.knowledge.fluid import reading_of
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.steady.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.result import Changed, Repair


def with_sensors_as_they_are(fitted: Fitted, setting: Configuration | None = None) -> Fitted:
    """Refit a setting (that of the fit unless given) without lasting sensor errors.

    Errors of single recordings remain: values that absorb them would be wrong for the next one.
    Terms without physics are removed: nobody should rely on them.
    """
    setting = fitted.setting if setting is None else setting
    for candidate in setting.joined:
        if candidate.sort == "free":
            setting = setting.leaving(candidate.id)
    held, inflation = no_lasting_errors(fitted.rows.system), fitted.variance_inflation
    return fit(fitted.rows, setting, fitted.used, held=held, variance_inflation=inflation)


def no_lasting_errors(system: System) -> dict[str, float]:
    """Lasting errors of sensors, each 0; errors of single recordings are not among them."""
    return {ERROR + name: 0.0 for name in system.shared}


def repair_of(settled: Fitted, covariance: Array) -> Repair:
    """The changes of a plant by a refitted model.

    `covariance`, shape (values, values), SI, is that of all values of its prior.
    """
    setting, system = settled.setting, settled.rows.system
    known = {*system.builder.parameters.ids, *setting.free_unknowns()}
    names = [n for n in settled.prior.names if n in known]
    places = [settled.prior.names.index(n) for n in names]
    covariance = covariance[np.ix_(places, places)]
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Repair(
        setting.ids,
        tuple(
            Changed(n, float(setting.values[n]), float(doubt))
            for n, doubt in zip(names, u, strict=True)
        ),
        covariance,
        {u.id: setting.fixed[u.id] for c in setting.joined for u in c.unknowns if u.fixed},
        _misfit(settled),
        _ranges(settled),
    )


def _misfit(settled: Fitted) -> dict[str, float]:
    """Remaining differences between two estimates of a flow, noise included, as in calibration.

    They are attributed to the estimate that has a misfit at all, or to both alike. Outliers have
    other causes and are ignored.
    """
    system = settled.rows.system
    flows = system.flows(settled.setting)
    found: dict[str, float] = {}
    for spec in system.ruleset.residuals:
        ids = [t.observer for t in spec.terms]
        if len(ids) != 2 or not all(o in system.number for o in ids):
            continue
        first, second = (system.number[o] for o in ids)
        difference = flows.values[first] - flows.values[second]
        usable = settled.used & system.valid[first] & system.valid[second]
        off = difference[usable & np.isfinite(difference)]
        if not len(off):
            continue
        near = off[_near(off)]
        own = [o for o in ids if system.ruleset.observer_by_id[o].misfit > 0] or ids
        for name in own:
            value = float(np.sqrt(np.mean(near**2) / len(own)))
            found[name] = max(found.get(name, 0.0), value)
    return found


def _ranges(settled: Fitted) -> dict[str, tuple[float, float]]:
    """Range of readings in which all relations with a signal were tested and held.

    A relation is tested where all its estimates are usable. Where one is missing (no flow through a
    closed valve), the others remain untested; where they differ widely, the model or the plant is
    wrong. A signal that only drives a law is tested with the relations of its module. A meter has
    no law, so its use does not limit its range.
    """
    system, setting = settled.rows.system, settled.setting
    tested, fitted = _tested(settled), _with_values(settled)
    laws = {(c.module, reading_of(d)) for c in setting.joined for d in c.drivers.values()}
    found = {}
    for name in sorted(system.data.values.keys() & system.ruleset.signal_by_id):
        readers = {o.id for o in system.observers if name in o.signals and o.id in fitted}
        modules = {m for m, d in laws if d == name} if not readers else set()
        readers |= {o.id for o in system.observers if o.module in modules}
        own = [flags for ids, flags in tested.items() if readers.intersection(ids)]
        values = system.data.values[name]
        values = values[np.all(own, axis=0) & np.isfinite(values)] if own else values[:0]
        if len(values):
            found[name] = (float(values.min()), float(values.max()))
    return found


def _with_values(settled: Fitted) -> set[str]:
    """Observers with values that were fitted."""
    system, found = settled.rows.system, set()
    for observer in system.observers:
        plan = system.builder.plan(observer.module, settled.setting.ids)
        used = plan.select([f"q:{observer.id}"]).used_inputs
        if set(settled.prior.names).intersection(used):
            found.add(observer.id)
    return found


def _tested(settled: Fitted) -> dict[tuple[str, ...], np.ndarray]:
    """Flags of points, shape (n,), at which each relation (its observers) was tested and held;
    without relations that were never tested."""
    system = settled.rows.system
    flows = system.flows(settled.setting).values
    found = {}
    for spec in system.ruleset.residuals:
        ids = tuple(t.observer for t in spec.terms)
        if not all(o in system.number for o in ids):
            continue
        rows = [system.number[o] for o in ids]
        off = np.asarray(sum(t.sign * flows[i] for t, i in zip(spec.terms, rows, strict=True)))
        usable = settled.used & np.all(system.valid[rows], axis=0) & np.isfinite(off)
        if usable.any():
            usable[usable] = _near(off[usable])
            found[ids] = usable
    return found


def _near(off: Array) -> np.ndarray:
    """Flags of errors that are no outliers."""
    far = np.abs(off - np.median(off))
    spread = max(NORMAL_SPREAD * float(np.median(far)), 1e-300)
    return np.asarray(far <= limits.MISFIT_FAR * spread)


def plain_of(setting: Configuration) -> Configuration:
    """The plain model to compare with; faults that come and go stay, as no model has them."""
    for candidate in setting.joined:
        if not setting.in_periods & {u.id for u in candidate.unknowns}:
            setting = setting.leaving(candidate.id)
    return setting
