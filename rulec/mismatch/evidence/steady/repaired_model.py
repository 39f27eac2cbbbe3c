"""The repaired model for use: predicted readings, values to write, and its range of validity."""

from dataclasses import dataclass

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ResidualSpec, SignalSpec
from rulec_runtime.limits import NORMAL_SPREAD
from rulec_runtime.recordings.reading_unit import parse_unit

from rulec.algebra.tangent import run_with_slopes
from rulec.knowledge.fluid import reading_of
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import ERROR, Configuration
from rulec.mismatch.evidence.steady.fit import Fitted, fit
from rulec.mismatch.evidence.steady.system import System
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

    def predicted(self, setting: Configuration) -> Array:
        """The reading by a model, shape (n,), SI; NaN where there is none."""
        measured = self.system.data.values[self.signal.id]
        at = measured.copy()
        spread, largest = np.nanstd(measured[self.points]), np.nanmax(np.abs(measured))
        size = max(float(spread), 1e-6 * float(largest))
        settled = np.full(len(at), np.inf)
        for _ in range(limits.PREDICTOR_STEPS):
            value, slope = self._value(setting, at)
            with np.errstate(all="ignore"):
                step = np.clip(-value / slope, -10.0 * size, 10.0 * size)
            # Where the law has no value the iteration stays at the reading, which is no prediction.
            known = np.isfinite(step)
            at = np.where(known, at + step, at)
            settled = np.where(known, np.abs(step), np.inf)
            if np.max(settled[self.points & known], initial=0.0) < 1e-9 * size:
                break
        return np.where(self.points & (settled < 1e-3 * size), at, np.nan)

    def _value(self, setting: Configuration, at: Array) -> tuple[Array, Array]:
        """The residual at a value of the reading, and its slope by the reading."""
        system = self.system
        inputs = system.corrected(setting)
        error = system.error_at(self.signal.id, setting)
        inputs[self.signal.id] = at - error * system.shared.get(self.signal.id, np.zeros(1))
        value, slope = np.zeros(len(at)), np.zeros(len(at))
        for term in self.residual.terms:
            spec = system.ruleset.observer_by_id[term.observer]
            plan = system.builder.plan(spec.module, setting.ids, system.built_in(setting))
            key = f"q:{term.observer}"
            out, slopes = run_with_slopes(plan.select([key]), inputs, (self.signal.id,))
            value = value + term.sign * out[key]
            slope = slope + term.sign * slopes[key].get(self.signal.id, np.zeros(1))
        return value, slope

    def noise(self, setting: Configuration) -> Array:
        """Standard uncertainty of measured less predicted, by the noise of all readings, shape
        (n,)."""
        system = self.system
        flows = system.flows(setting)
        variance, own = np.zeros(len(system.data)), np.zeros(len(system.data))
        for name, slopes in flows.by_reading.items():
            total = np.zeros(len(system.data))
            for term in self.residual.terms:
                i = system.number[term.observer]
                total = total + term.sign * slopes.get(i, np.zeros(1))
            with np.errstate(invalid="ignore"):  # an estimate without a slope has no noise
                variance += (total * system.data.noise[name]) ** 2
            if name == self.signal.id:
                own = total
        with np.errstate(all="ignore"):
            return np.asarray(np.sqrt(variance) / np.abs(own))


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
        points = _usable(system, spec)
        for name in sorted({s for o in ids for s in system.ruleset.observer_by_id[o].signals}):
            signal = system.ruleset.signal_by_id[name]
            readers = [o for o in ids if name in system.ruleset.observer_by_id[o].signals]
            if signal.is_input or points.sum() < 3:
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
                found[name] = (rank, Predictor(system, spec, signal, points))
    ranked = sorted(found.values(), key=lambda f: f[0], reverse=True)
    return [predictor for _, predictor in ranked]


def predictor_of(system: System, relation: str, name: str) -> Predictor:
    """A residual, by its id, solved for a reading."""
    spec = next(s for s in system.ruleset.residuals if s.id == relation)
    points = _usable(system, spec)
    return Predictor(system, spec, system.ruleset.signal_by_id[name], points)


def _usable(system: System, spec: ResidualSpec) -> np.ndarray:
    """Points at which all estimates of a residual may be used, shape (n,)."""
    return np.asarray(np.all(system.valid[[system.number[t.observer] for t in spec.terms]], axis=0))


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
