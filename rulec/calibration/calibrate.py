"""From a fault-free recording to the parameters of a plant: the steps in order."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.steady.points import Points, points_of_stretches
from rulec_runtime.recordings.point_table import NOTE, each_row, is_point_table
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import settle, systematic_u
from rulec_runtime.report.text import listed
from rulec_runtime.report.wording import treatment_of

from rulec.calibration.fit import CalibrationRefused, ModuleFit, fit_module
from rulec.calibration.law import Readings
from rulec.calibration.limits import FAR_OFF, OTHER_SIZE
from rulec.calibration.true_flow import Local, true_flows
from rulec.knowledge.parameter_belief import Strain, strain_of
from rulec.knowledge.plant import Module
from rulec.limits import UNBELIEVABLE
from rulec.passes.differentiate import GATHERED
from rulec.passes.types import Compilation


@dataclass(frozen=True, kw_only=True)
class Calibrated:
    """Fits of the modules whose true flow is known.

    Attributes
    ----------
    points : number of settled stretches fitted to, or of rows of a `table` of operating points.
    sensors : remarks on unusable and doubtful readings.
    """

    models: Compilation
    fits: tuple[ModuleFit, ...]
    points: int
    table: bool
    sensors: tuple[str, ...]

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Operating states set aside, values of another order of magnitude than stated, and
        readings that were not varied."""
        modules = self.models.plant.modules
        notes = [note for fit in self.fits for note in _notes(modules[fit.module], fit)]
        return (*notes, *([NOTE] if self.table else []))

    @cached_property
    def strain(self) -> tuple[Strain, ...]:
        """Parameters that lie far from their data sheets, the farthest first."""
        values, sheet, units = {}, {}, {}
        for fit in self.fits:
            for name, value in zip(fit.parameters, fit.values.tolist(), strict=True):
                stated = self.models.plant.modules[fit.module].stated[name]
                own = f"{fit.module}.{name}"
                values[own], sheet[own] = value, (stated.value, stated.u)
                units[own] = stated.unit.text, stated.unit.factor
        return strain_of(values, sheet, units)

    @property
    def unbelievable(self) -> tuple[Strain, ...]:
        """Parameters so far from their data sheets that they are not credible.

        The uncertainty of the fit includes the errors of the calibrating sensors, which the sheet
        does not know, and those of the forms of laws.

        Source: zeta score (ISO 13528), two values, each with its uncertainty.
        """
        uncertainty = {
            f"{fit.module}.{name}": u
            for fit in self.fits
            for name, u in zip(
                fit.parameters, np.hypot(np.sqrt(np.diag(fit.covariance)), fit.by_form), strict=True
            )
        }
        plant, far = self.models.plant, []
        for strain in self.strain:
            module, _, name = strain.parameter.partition(".")
            u = uncertainty[strain.parameter] / plant.modules[module].stated[name].unit.factor
            if abs(strain.value - strain.stated) > UNBELIEVABLE * float(np.hypot(u, strain.u)):
                far.append(strain)
        return tuple(far)

    @cached_property
    def moved(self) -> tuple[str, ...]:
        """Parameters that differ from the data sheet."""
        every = (f"{fit.module}.{name}" for fit in self.fits for name in fit.parameters)
        return tuple(name for name in every if name not in self.untold)

    @cached_property
    def untold(self) -> tuple[str, ...]:
        """Parameters that the recording determines hardly better than the data sheet."""
        return tuple(name for fit in self.fits for name in self.untold_of(fit))

    def untold_of(self, fit: ModuleFit) -> list[str]:
        """Such parameters of a module."""
        far = {s.parameter for s in self.strain}
        return [name for n in fit.untold if (name := f"{fit.module}.{n}") not in far]

    @property
    def left_out(self) -> tuple[str, ...]:
        """Modules with estimates of their own that were not fitted."""
        plant, fitted = self.models.plant, {fit.module for fit in self.fits}
        modules = plant.modules.values()
        return tuple(m.name for m in modules if m.type.observers and m.name not in fitted)


def calibrated(models: Compilation, recording: Recording, name: str) -> Calibrated:
    """Fit every module that ran and whose true flow a fault-free recording determines.

    `name` is that of the recording in messages. Raises `CalibrationRefused` if nothing settled, if
    no module has a law and a true flow, or if one cannot be fitted.
    """
    settled = settled_points(models, recording, name)
    modules = models.plant.modules.values()
    local = {m.name: local_readings(models, settled.points, m) for m in modules}
    flows = true_flows(models, local)
    fits = []
    for module in modules:
        if module.name not in flows or all(o.is_reference for o in module.type.observers.values()):
            continue
        flow = flows[module.name]
        if np.nansum(np.abs(flow.values)) > 0.0:  # else it never ran, and keeps its values
            readings = Readings(local[module.name], flow)
            fits.append(fit_module(module, models.types[module.type.key], readings))
    fits = [fit for fit in fits if fit.observers]
    if not fits:
        stores = listed([m.name for m in modules if m.type.states])
        balances = f"; `rulec mismatch` fits the balances of {stores}" if stores else ""
        raise CalibrationRefused(
            "no module has a law with all its readings and a true flow to fit it to, from a flow "
            "meter that is not zero throughout or an observer with 'reference: true'"
            f"{balances}"
        )
    return Calibrated(
        models=models,
        fits=tuple(fits),
        points=len(settled.points),
        table=settled.table,
        sensors=settled.sensors,
    )


@dataclass(frozen=True)
class Settled:
    """Input of a fit: `points`, which are rows of a `table` of operating points or settled
    stretches, and remarks on `sensors`."""

    points: Points
    table: bool
    sensors: tuple[str, ...]


def settled_points(models: Compilation, recording: Recording, name: str) -> Settled:
    """Points of a fault-free recording. Raises `CalibrationRefused` if nothing settled."""
    ruleset = models.ruleset
    health = examine(recording, ruleset, by_model=False)
    recording = health.recording
    table = is_point_table(recording, ruleset)
    stretches, noise = settle(recording, ruleset)
    if table:
        # The noise of a single row is unknown; it is part of the misfit.
        stretches, noise = each_row(recording), dict.fromkeys(noise, 0.0)
    if not len(stretches):
        raise CalibrationRefused(
            f"{name}: no settled stretch was found; hold operating points for longer, or record "
            "the stretches in which they are held"
        )
    return Settled(
        points_of_stretches(recording, ruleset, stretches, noise),
        table,
        tuple(f"{f.text}; {treatment_of(f)}" for f in health.findings),
    )


def local_readings(models: Compilation, points: Points, module: Module) -> Local:
    """Readings of a module; those below their minimum are NaN."""
    ruleset = models.ruleset
    values: dict[str, Array] = {}
    systematic: dict[str, Array] = {}
    statistical: dict[str, Array] = {}
    for name in module.type.signals:
        signal = ruleset.signal_by_id[f"{module.name}.{name}"]
        if signal.id not in points.values:
            continue
        readings = points.values[signal.id].copy()
        if signal.minimum is not None:
            readings[~(readings >= signal.minimum)] = np.nan
        values[name] = readings
        systematic[name] = np.broadcast_to(systematic_u(signal, readings), readings.shape)
        statistical[name] = points.statistical(signal.id)
    n = len(next(iter(points.values.values())))
    for name in module.type.gathers:
        ids = [f"{m}.{s}" for m, s in models.network.gathers[module.name, name]]
        complete = all(i in points.values for i in ids)
        parts = [points.values[i] for i in ids] if complete else [np.full(n, np.nan)]
        shared = [systematic_u(ruleset.signal_by_id[i], points.values[i]) for i in ids if complete]
        new = [points.statistical(i) for i in ids if complete]
        values[GATHERED + name] = np.sum(parts, axis=0) if parts else np.zeros(n)
        systematic[GATHERED + name] = _root_of_squares(shared, n)
        statistical[GATHERED + name] = _root_of_squares(new, n)
    return Local(values, systematic, statistical)


def _root_of_squares(parts: Sequence[Array], n: int) -> Array:
    return np.sqrt(sum((np.broadcast_to(p, (n,)) ** 2 for p in parts), np.zeros(n)))


def _notes(module: Module, fit: ModuleFit) -> Iterator[str]:
    """Notes on laws without readings, on operating states that no law was fitted to, on parameters
    without a stated uncertainty that are of another order of magnitude than stated, and on readings
    that were not varied."""
    for observer, absent in fit.unread.items():
        sums = (n.removeprefix(GATHERED) for n in absent if n.startswith(GATHERED))
        own = (f"{fit.module}.{n}" for n in absent if not n.startswith(GATHERED))
        lacking = ", ".join((*own, *(f"downstream({name})" for name in sums)))
        yield f"{fit.module}.{observer} keeps its data sheet: no reading of {lacking}"
    for law in fit.observers:
        for name, z in law.far.items():
            sensor = f"{fit.module}.{name}" if name in module.type.signals else name
            yield (
                f"{fit.module}.{law.observer}: its points lie beside the law as if {sensor} were "
                f"off by {abs(z):.2g} u of its class. Look for a wrong zero, a column in a wrong "
                "unit, or values of the sheet that are stated too exactly; until then the misfit "
                "is that of this error, and hides faults"
            )
    for one in fit.states_set_aside:
        unit = module.type.signals[one.signal].unit
        low, high = (f"{unit.from_si(end):.4g}" for end in (one.low, one.high))
        yield (
            f"{fit.module}.{one.observer}: {one.points} of {one.of} points, those with "
            f"{fit.module}.{one.signal} from {low} to {high} {unit.text}, were set aside: no "
            "parameters fit them and the others. If the plant was sound there, the law is "
            "wrong, and this file holds for the other points alone; rulec mismatch shows where"
        )
    u = np.sqrt(np.diag(fit.covariance)).tolist()
    for name, value, error in zip(fit.parameters, fit.values.tolist(), u, strict=True):
        stated = module.stated[name]
        unit = stated.unit
        old, new = abs(stated.value - unit.offset), abs(value - unit.offset)
        alike = not old or old / OTHER_SIZE <= new <= old * OTHER_SIZE
        if not stated.u and not alike and abs(value - stated.value) > FAR_OFF * error:
            yield (
                f"{fit.module}.{name}: the recording says {unit.from_si(value):.4g} {unit.text}, "
                f"the data sheet {unit.from_si(stated.value):.4g} {unit.text}; check the units of "
                "the columns and the equation of the flow meter before this file is used"
            )
    when = "in all points that were kept" if fit.states_set_aside else "all the time"
    for name, found in fit.valid.items():
        if found.unvaried:
            unit = module.type.signals[name].unit
            low, high = (f"{unit.from_si(end):.4g}" for end in (found.low, found.high))
            yield (
                f"{fit.module}.{name} stood {when}, as far as its sensor can tell; the laws "
                f"count as tested from {low} to {high} {unit.text} alone, and beyond that no fault "
                "is named. Vary it in the calibration if it varies in operation"
            )
