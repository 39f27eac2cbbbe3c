"""The repaired model for use: predicted readings, values to write, and its range of validity."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ResidualSpec, SignalSpec
from rulec_runtime.limits import NORMAL_SPREAD
from rulec_runtime.recordings.reading_unit import parse_unit

from rulec.knowledge.fluid import reading_of
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.system import Flows, System
from rulec.mismatch.result import Changed, Repair
from rulec.simulation.predict_settled import is_flow

# Predict a reading from the others, for errors in units that a user understands.
#
# A residual of the ruleset is solved for one of its readings, so that its error has the unit of
# that signal.


@dataclass(frozen=True)
class Predictor:
    """A residual and the reading it is solved for; `points` flags those where it can be used."""

    system: System
    residual: ResidualSpec
    signal: SignalSpec
    points: np.ndarray

    @property
    def of_flow(self) -> bool:
        """Is the reading a volume flow?"""
        return is_flow(self.signal, self.system.ruleset)

    @property
    def by_inputs(self) -> bool:
        """Does the reading follow from inputs alone, as in a simulation?"""
        signals, observers = self.system.ruleset.signal_by_id, self.system.ruleset.observer_by_id
        read = {name for term in self.residual.terms for name in observers[term.observer].signals}
        return all(signals[name].is_input for name in read - {self.signal.id})

    def predicted(self, setting: Configuration) -> Array:
        """The reading by a model, shape (n,), SI; NaN where there is none."""
        measured, name = self.system.data.values[self.signal.id], self.signal.id
        at = measured.copy()
        spread, largest = np.nanstd(measured[self.points]), np.nanmax(np.abs(measured))
        size = max(float(spread), 1e-6 * float(largest))
        settled = np.full(len(at), np.inf)
        for _ in range(limits.PREDICTOR_STEPS):
            flows = self._flows(setting, {name: at})
            value = self._combined(dict(enumerate(flows.values)))
            with np.errstate(all="ignore"):
                slope = self._combined(flows.by_reading.get(name, {}))
                step = np.clip(-value / slope, -10.0 * size, 10.0 * size)
            # Where the law has no value the iteration stays at the reading, which is no prediction.
            finite = np.isfinite(step)
            at = np.where(finite, at + step, at)
            settled = np.where(finite, np.abs(step), np.inf)
            if np.max(settled[self.points & finite], initial=0.0) < 1e-9 * size:
                break
        return np.where(self.points & (settled < 1e-3 * size), at, np.nan)

    def noise(self, setting: Configuration) -> Array:
        """Standard uncertainty of measured less predicted, by the noise of all readings, shape
        (n,)."""
        data, slopes = self.system.data, self._flows(setting).by_reading
        total = {name: self._combined(by) for name, by in slopes.items()}
        with np.errstate(all="ignore"):  # an estimate without a slope has no noise
            parts = [(slope * data.noise[name]) ** 2 for name, slope in total.items()]
            return np.asarray(np.sqrt(sum(parts)) / np.abs(total[self.signal.id]))

    def _flows(self, setting: Configuration, at: Mapping[str, Array] | None = None) -> Flows:
        modules = self.system.reached([term.observer for term in self.residual.terms])
        return self.system.flows(setting, modules=modules, at=at)

    def _combined(self, estimates: Mapping[int, Array]) -> Array:
        """The residual of estimates, or of their slopes, by number of the observer, shape (n,)."""
        total = np.zeros(len(self.system.data))
        for term in self.residual.terms:
            part = estimates.get(self.system.number[term.observer])
            total = total if part is None else total + term.sign * part
        return total


def predictors_for(
    system: System, observers: tuple[str, ...], drivers: frozenset[str], unit: str = ""
) -> list[Predictor]:
    """Residuals and readings that show the error of some observers, the most natural first.

    A reading of the dimension of the place (`unit`) is best, then one of only one side of the
    residual, such as that of a flow meter.
    """
    kind = parse_unit(unit, system.ruleset.units)
    modules = {o.rpartition(".")[0] for o in observers}
    found: dict[str, tuple[tuple[float, ...], Predictor]] = {}
    for spec in system.ruleset.residuals:
        ids = [t.observer for t in spec.terms]
        touched = [o for o in ids if o in observers]
        if not touched or not all(o in system.number for o in ids):
            continue
        for name in sorted({s for o in ids for s in system.ruleset.observer_by_id[o].signals}):
            signal = system.ruleset.signal_by_id[name]
            readers = [o for o in ids if name in system.ruleset.observer_by_id[o].signals]
            predictor = predictor_of(system, spec.id, name)
            if signal.is_input or predictor.points.sum() < 3:
                continue
            own = parse_unit(signal.unit, system.ruleset.units)
            alike = kind is not None and own is not None and kind.dimension == own.dimension
            rank = (
                float(alike),
                float(name.partition(".")[0] in modules),
                float(name not in drivers),
                float(len(readers) == 1),
                float(len(touched) < len(ids)),
                -float(len(ids)),
                -float(len(system.ruleset.observer_by_id[readers[0]].signals)),
                float(readers[0] not in observers),
            )
            if name not in found or rank > found[name][0]:
                found[name] = (rank, predictor)
    ranked = sorted(found.values(), key=lambda f: f[0], reverse=True)
    return [predictor for _, predictor in ranked]


def predictor_of(system: System, relation: str, name: str) -> Predictor:
    """A residual, by its id, solved for a reading."""
    spec = next(s for s in system.ruleset.residuals if s.id == relation)
    points = np.all(system.valid[[system.number[t.observer] for t in spec.terms]], axis=0)
    return Predictor(system, spec, system.ruleset.signal_by_id[name], np.asarray(points))


# The repaired model for use: without lasting sensor errors, and with its range of validity.
#
# In the search each sensor may err within its class. Users of the model read the same sensors, so
# their lasting errors belong into the parameters, as in any calibration on site. Errors of single
# recordings do not.


def with_sensors_as_they_are(fitted: Fitted, setting: Configuration | None = None) -> Fitted:
    """Refit a setting (that of the fit unless given) without lasting sensor errors.

    Errors of single recordings remain: values that absorb them would be wrong for the next one.
    Terms without physics are removed: nobody should rely on them.
    """
    setting = fitted.setting if setting is None else setting
    setting = setting.leaving(*(c.id for c in setting.joined if c.sort == "free"))
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
    wanted = {*system.builder.parameters.ids, *setting.free_unknowns()}
    names = [n for n in settled.prior.names if n in wanted]
    indices = [settled.prior.names.index(n) for n in names]
    covariance = covariance[np.ix_(indices, indices)]
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return Repair(
        setting.ids,
        tuple(
            Changed(n, float(setting.values[n]), float(own))
            for n, own in zip(names, u, strict=True)
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
    observers, found = settled.rows.system.ruleset.observer_by_id, dict[str, float]()
    for ids, off in _held(settled).items():
        own = [o for o in ids if observers[o].misfit > 0] or ids
        for name in own if len(ids) == 2 else ():
            value = float(np.sqrt(np.nanmean(off**2) / len(own)))
            found[name] = max(found.get(name, 0.0), value)
    return found


def _ranges(settled: Fitted) -> dict[str, tuple[float, float]]:
    """Range of readings in which all relations with a signal were tested and held.

    A relation is tested where all its estimates are usable. Where one is missing (no flow through a
    closed valve), the others remain untested; where they differ widely, the model or the plant is
    wrong. A signal that only drives a law is tested with the relations of its module. A meter has
    no law, so its use does not limit its range.
    """
    system, setting, found = settled.rows.system, settled.setting, {}
    held, values = _held(settled), set(settled.prior.names)
    plans = {o.module: system.builder.plan(o.module, setting.ids) for o in system.observers}
    with_values = [
        o for o in system.observers if values & {*plans[o.module].select([f"q:{o.id}"]).used_inputs}
    ]
    laws = {(c.module, reading_of(d)) for c in setting.joined for d in c.drivers.values()}
    for name in sorted(system.data.values.keys() & system.ruleset.signal_by_id):
        readers = {o.id for o in with_values if name in o.signals}
        modules = {m for m, d in laws if d == name} if not readers else set()
        readers |= {o.id for o in system.observers if o.module in modules}
        own = [np.isfinite(off) for ids, off in held.items() if readers.intersection(ids)]
        read = system.data.values[name]
        read = read[np.all(own, axis=0) & np.isfinite(read)] if own else read[:0]
        if len(read):
            found[name] = (float(read.min()), float(read.max()))
    return found


def _held(settled: Fitted) -> dict[tuple[str, ...], Array]:
    """What is left of each relation (its observers), shape (n,), m3/s, where it was tested and
    held, NaN elsewhere; without relations that were never tested."""
    system, found = settled.rows.system, {}
    flows = system.flows(settled.setting).values
    for spec in system.ruleset.residuals:
        ids = tuple(t.observer for t in spec.terms)
        if not all(o in system.number for o in ids):
            continue
        rows = [system.number[o] for o in ids]
        off = np.asarray(sum(t.sign * flows[i] for t, i in zip(spec.terms, rows, strict=True)))
        usable = settled.used & np.all(system.valid[rows], axis=0) & np.isfinite(off)
        if usable.any():
            usable[usable] = _near(off[usable])
            found[ids] = np.where(usable, off, np.nan)
    return found


def _near(off: Array) -> np.ndarray:
    """Flags of errors that are no outliers."""
    far = np.abs(off - np.median(off))
    spread = max(NORMAL_SPREAD * float(np.median(far)), 1e-300)
    return np.asarray(far <= limits.MISFIT_FAR * spread)
