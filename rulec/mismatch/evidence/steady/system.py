"""The relations of a plant at the points of a recording: estimates of all observers, and slopes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import ObserverSpec, Ruleset
from rulec_runtime.diagnosis.steady.observe import Observed, observe

from rulec.algebra.tangent import run_with_slopes
from rulec.effects.candidate import TIME, Candidate, DisturbanceLocation
from rulec.effects.model_builder import ModelBuilder
from rulec.knowledge.parameter_belief import Belief
from rulec.mismatch.evidence.configuration import (
    CHANGE,
    ERROR,
    Configuration,
    own_error,
    reading_and_recording,
)
from rulec.mismatch.evidence.prior import belief_of
from rulec.mismatch.evidence.steady.prepare import Data

Slopes = dict[str, dict[int, Array]]
"""Derivatives by the name of a free value and the number of each observer that depends on it."""


@dataclass(frozen=True)
class Flows:
    """Estimates of all observers, shape (observers, n), m3/s, and their slopes.

    `by_reading` are slopes by readings, `by_value` by free values.
    """

    values: Array
    by_reading: Slopes
    by_value: Slopes


@dataclass(frozen=True)
class System:
    """A plant and the points of a recording.

    `observers` are those with recorded readings; all arrays over observers have this order.
    """

    ruleset: Ruleset
    builder: ModelBuilder
    data: Data

    @cached_property
    def observers(self) -> tuple[ObserverSpec, ...]:
        present = {name for name, v in self.data.values.items() if np.isfinite(v).any()}
        return tuple(o for o in self.ruleset.observers if set(o.signals) <= present)

    @cached_property
    def modules(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(o.module for o in self.observers))

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Possible explanations; without a common clock, only those that do not follow time."""
        every = [c for c in self.builder.candidates if self.data.timed or not c.follows_time]
        measured = {
            signal.quantity
            for module in self.builder.network.plant.modules.values()
            for signal in module.type.signals.values()
            if np.isfinite(self.data.values.get(f"{module.name}.{signal.name}", np.nan)).any()
        }
        # Where a property of the fluid is measured, its reading is the driver.
        fluid = self.builder.fluid_drivers
        replaced = {driver for driver, own in fluid.items() if own.name in measured}
        return tuple(c for c in every if replaced.isdisjoint(c.drivers.values()))

    @cached_property
    def belief(self) -> Belief:
        """The prior of the parameters of these modules that recalibration may change."""
        base = self.builder.parameters
        u = np.sqrt(np.diag(base.covariance)) if len(base.ids) else np.zeros(0)
        inside = [name.partition(".")[0] in self.modules for name in base.ids]
        return belief_of(base, np.flatnonzero((u > 0) & np.array(inside, dtype=bool)).tolist())

    @cached_property
    def number(self) -> Mapping[str, int]:
        """Number of each observer."""
        return {o.id: i for i, o in enumerate(self.observers)}

    @cached_property
    def observed(self) -> Observed:
        """Estimates of all observers of the ruleset by the plain plan."""
        return observe(self.ruleset, self.data.points)

    @cached_property
    def valid(self) -> np.ndarray:
        """Flags of usable estimates, shape (observers, n)."""
        every, index = self.observed.valid, self.ruleset.observer_index
        valid = np.array([every[index[o.id]] for o in self.observers])
        for row, observer in zip(valid, self.observers, strict=True):
            if observer.module in self.data.moving:
                row &= ~self.data.moving[observer.module]
        return valid

    @cached_property
    def inputs(self) -> dict[str, Array | float]:
        """Recorded readings and the clock, shape (n,), and constants; SI."""
        return {**self.data.values, TIME: self.data.clock, **self.builder.parameters.constants}

    @cached_property
    def shared(self) -> Mapping[str, Array]:
        """Systematic standard uncertainty of each reading, shape (n,)."""
        used = {s for o in self.observers for s in o.signals}
        return {name: u for name, u in self.data.points.systematic.items() if name in used}

    @cached_property
    def errors(self) -> tuple[str, ...]:
        """Names of sensor errors: the lasting ones, and those of single recordings."""
        numbers = np.unique(self.data.source).tolist() if self.data.sources else []
        own = [own_error(name, number) for number in numbers for name in self.shared]
        return (*(ERROR + name for name in self.shared), *own)

    def error_at(self, name: str, setting: Configuration) -> Array | float:
        """The error of a reading in uncertainties of its class, shape (n,) where recordings
        differ."""
        values, lasting = setting.values, setting.values.get(ERROR + name, 0.0)
        if not self.data.sources:
            return lasting
        count = len(self.data.sources)
        own = np.array([values.get(own_error(name, number), 0.0) for number in range(count)])
        return np.asarray(lasting + own[self.data.source])

    def corrected(
        self, setting: Configuration, at: Mapping[str, Array] | None = None
    ) -> dict[str, Array | float]:
        """Plan inputs, SI: readings, shape (n,), corrected for sensor errors, and all values."""
        inputs = {**self.inputs, **(at or {}), **setting.fixed, **setting.values}
        parameters = self.builder.parameters
        for name, value in zip(parameters.ids, parameters.values, strict=True):
            inputs.setdefault(name, float(value))
        for course in setting.courses:
            degrees, name = course.degrees(setting.values), course.unknown.removesuffix(CHANGE)
            inputs[name] = degrees if name == course.unknown else inputs[name] + degrees
        for name, u in self.shared.items():
            error = self.error_at(name, setting)
            if np.any(error):
                inputs[name] = inputs[name] - error * u
        return inputs

    def flows(
        self,
        setting: Configuration,
        by: Sequence[str] = (),
        locations: Sequence[str] = (),
        modules: Sequence[str] | None = None,
        at: Mapping[str, Array] | None = None,
    ) -> Flows:
        """Evaluate the observers of all (or some) modules.

        Parameters
        ----------
        by : names of free values to differentiate by, sensor errors included.
        locations : ids of places with an unknown error of value 0, whose name may be in `by`.
        at : readings instead of the recorded ones, shape (n,), SI.
        """
        inputs = self.corrected(setting, at)
        values = np.full((len(self.observers), len(self.data)), np.nan)
        by_reading: Slopes = {}
        raw: Slopes = {}
        # Places are slow to find, so only if needed.
        by_id = self.builder.location_by_id if locations or setting.locations else {}
        built = self.built_in(setting)
        locations = (*(s for s in locations if s in by_id and s not in built), *built)
        by_plan = list(dict.fromkeys(name.removesuffix(CHANGE) for name in by))
        for module in self.modules if modules is None else modules:
            plan = self.builder.plan(module, setting.ids, locations)
            zero = {by_id[s].unknown: 0.0 for s in locations if s not in built}
            signals = [name for name in plan.inputs if name in self.shared]
            names = [o for o in self.observers if o.module == module]
            wanted = plan.select([f"q:{o.id}" for o in names])
            out, slopes = run_with_slopes(wanted, {**inputs, **zero}, [*by_plan, *signals])
            for observer in names:
                i, key = self.number[observer.id], f"q:{observer.id}"
                values[i] = out[key]
                for name, slope in slopes[key].items():
                    table = by_reading if name in self.shared else raw
                    table.setdefault(name, {})[i] = slope
        return Flows(values, by_reading, self._of_values(by, raw, by_reading))

    def built_in(self, setting: Configuration) -> tuple[str, ...]:
        """Places whose error needs an input of the plans; parameters are inputs already."""
        ids = {s.id for s in self.builder.locations} if setting.locations else set()
        return tuple(s for s in setting.locations if s in ids)

    def value_of(self, location: DisturbanceLocation) -> Array:
        """Value of the plain law at a place, shape (n,), in SI of the place."""
        kind = "d:" if location.kind == "definition" else f"q:{location.module}."
        name = kind + location.place
        plan = self.builder.plan(location.module, (), definitions=True).select([name])
        with np.errstate(all="ignore"):
            value = plan.run(self.corrected(Configuration()))[name]
        return np.broadcast_to(np.asarray(value, dtype=float), (len(self.data),))

    def reached(self, observers: Sequence[str]) -> tuple[str, ...]:
        """Modules of some observers, in order."""
        touched = {o.rpartition(".")[0] for o in observers}
        return tuple(m for m in self.modules if m in touched)

    def _of_values(self, by: Sequence[str], raw: Slopes, by_reading: Slopes) -> Slopes:
        """Slopes by free values; those by sensor errors follow from slopes by readings."""
        result: Slopes = {}
        for name in by:
            if not name.startswith(ERROR):
                result[name] = raw.get(name.removesuffix(CHANGE), {})
            else:
                signal, number = reading_and_recording(name)
                u = self.shared[signal]
                if number is not None:
                    u = u * (self.data.source == number)
                with np.errstate(invalid="ignore"):  # An estimate may be infinite, a class unknown.
                    result[name] = {i: -s * u for i, s in by_reading.get(signal, {}).items()}
        return result


def system_of(ruleset: Ruleset, builder: ModelBuilder, data: Data) -> System:
    """A plant and its settled points, with the properties of its fluid there."""
    return System(ruleset, builder, with_properties(builder, data))


def with_properties(builder: ModelBuilder, data: Data) -> Data:
    """Add the properties of the fluid to settled points.

    They are unknown if a recorded temperature is outside the range of the equations.
    """
    points, noise = data.points, dict(data.noise)
    values, u, systematic = dict(points.values), dict(points.u), dict(points.systematic)
    for name, driver in builder.fluid_drivers.items():
        temperature = points.values.get(driver.signal)
        if temperature is None or not driver.knows(temperature):
            continue
        values[name], slope = driver.at(temperature)
        noise[name] = np.abs(slope) * data.noise[driver.signal]
        u[name] = np.abs(slope) * points.u[driver.signal]
        systematic[name] = np.abs(slope) * points.systematic[driver.signal]
    extended = replace(points, values=values, u=u, systematic=systematic)
    return replace(data, points=extended, noise=noise)
