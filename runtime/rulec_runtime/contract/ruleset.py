"""The ruleset: what the compiler hands to the runtime. Data only, SI inside."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from typing import Any, TypeVar

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.fault_frequency import FREQUENCY_ODDS
from rulec_runtime.contract.file_form import INFERRED, FileForm
from rulec_runtime.contract.plan import Array, Plan, cached_plan
from rulec_runtime.output.json_file import DIGEST, digest_of

Size = TypeVar("Size", float, Array)

FORMAT_VERSION = 4

FORM = ".form"
"""Suffix of a law's id: its error of form in gradients."""

MISFIT = "~"
"""Suffix of errors in gradients that are new at every operating point: behind the id of an
observer its own misfit, behind that of a form the part that is not everywhere alike."""

UNCERTAINTIES = ("full scale", "reading", "value")
"""The systematic uncertainty of a sensor is a share of one of these, or a value."""

USUAL = "usual"
"""Default frequency of a fault; `FREQUENCY_ODDS` lists all of them."""

SELDOM = {"seldom": True}
"""Mark of a field that is written to a file only if it differs from its default."""


@dataclass(frozen=True, kw_only=True)
class SignalSpec:
    """A measured value: SI = reading * factor + offset.

    `kind` and `standard` give the systematic standard uncertainty (a share of full scale or of the
    reading, or a value in SI). `valid_from`, `valid_to` bound the range in which the equations were
    calibrated; below `minimum` nothing is judged. `between` samples an input reading keeps its
    value (``hold``) or is interpolated linearly (``line``).
    """

    id: str
    title: str
    unit: str
    factor: float
    offset: float
    kind: str
    standard: float
    full_scale: float | None
    lowest: float | None
    highest: float | None
    minimum: float | None
    valid_from: float | None
    valid_to: float | None
    is_input: bool
    reference: float
    between: str = field(default="hold", metadata=SELDOM)

    @property
    def ends(self) -> tuple[float, float]:
        """Range of the sensor, SI; unbounded where unknown."""
        low, high = self.lowest, self.highest
        return -math.inf if low is None else low, math.inf if high is None else high

    def shown(self, value: Size) -> Size:
        """A value, or several, SI, in the sensor's own unit."""
        return (value - self.offset) / self.factor


@dataclass(frozen=True)
class ColumnMap:
    """A column of a foreign file; SI = value * factor + offset.

    A signal with several columns is their sum; the factor of a subtracted one is negative.
    """

    signal: str
    column: str
    factor: float
    offset: float


@dataclass(frozen=True)
class UnitSpec:
    """A unit of recordings; `dimension` are exponents of m, kg, s, K, A."""

    factor: float
    offset: float
    dimension: tuple[float, ...]


@dataclass(frozen=True)
class Guard:
    """A plan output that must be positive, and its name in messages."""

    output: str
    text: str


@dataclass(frozen=True, kw_only=True)
class ObserverSpec:
    """An estimate of the flow through a module; `signals` are all readings it depends on."""

    id: str
    module: str
    component: str
    equation: str
    signals: tuple[str, ...]
    guards: tuple[Guard, ...]
    misfit: float
    reference: float
    origin: str


@dataclass(frozen=True)
class Junction:
    """Flows balance here: those out of `outlets` go into `inlets`."""

    outlets: tuple[str, ...]
    inlets: tuple[str, ...]


@dataclass(frozen=True)
class Term:
    """A signed observer in a residual."""

    observer: str
    sign: int


@dataclass(frozen=True)
class ResidualSpec:
    """A signed sum of observers that is zero in a healthy plant."""

    id: str
    module: str
    terms: tuple[Term, ...]
    text: str
    u: float


@dataclass(frozen=True, kw_only=True)
class FaultSpec:
    """A hypothesis.

    `affects` lists the observers that it biases, `scales` the signals in what it scales: only these
    may leave the calibrated range because of the fault. `in_sensor`: the reading itself is scaled,
    errors and all; else the quantity, and so the errors of its estimates. With a `unit` the degree
    is a size added to the reading; else it is a share. `frequency` is how often it occurs relative
    to other faults, by `frequency_origin`. A degree of `absurd` or more is not credible, if that is
    below `highest`. An `unlisted` fault may be in any reading of its class: no module lists it, and
    no rule gives its degree.
    """

    id: str
    module: str
    fault: str
    title: str
    text: str
    action: str
    status: str
    lowest: float
    highest: float
    tolerance: float
    meaning: str
    affects: tuple[str, ...]
    scales: tuple[str, ...]
    in_sensor: bool
    origin: str
    unit: str = field(default="", metadata=SELDOM)
    frequency: str = field(default=USUAL, metadata=SELDOM)
    frequency_origin: str = field(default="", metadata=SELDOM)
    absurd: float | None = field(default=None, metadata=SELDOM)
    unlisted: bool = field(default=False, metadata=SELDOM)

    @property
    def credible(self) -> float:
        """Degrees below this are credible; at the end of the range any mismatch piles up."""
        end = self.highest * (1.0 - limits.END_OF_RANGE)
        return end if self.absurd is None else min(end, self.absurd)

    @property
    def scale(self) -> float:
        """Degree over this is a share: of what the fault acts on, or of its sensor's range."""
        return self.highest if self.unit else 1.0

    @property
    def odds(self) -> float:
        """Prior odds relative to a listed fault of usual frequency."""
        listed = limits.UNLISTED_ODDS if self.unlisted else 1.0
        return listed * FREQUENCY_ODDS[self.frequency]


@dataclass(frozen=True)
class Cell:
    """A non-zero entry of the fault-symptom matrix at the reference point.

    `gain` is dR/dg (g: what the fault scales), `sensitivity` dR/dx in m3/s per unit of degree,
    `detectable` the degree at which the residual leaves its threshold. `forms` lists the rule forms
    that the plan holds as ``x:<form>:<fault>:<residual>``; an unlisted fault has none.
    """

    fault: str
    residual: str
    sign: int
    gain: float
    sensitivity: float
    detectable: float
    forms: tuple[str, ...]
    equation: str


@dataclass(frozen=True)
class AdvisedSensor:
    """A further reading of a signal; `cost` is relative to other sensors."""

    module: str
    signal: str
    cost: float


@dataclass(frozen=True)
class AmbiguousGroup:
    """Faults that are hard or impossible to distinguish, and the sensors that would help.

    `degrees`, per fault, are those from which on it is distinguishable at one operating point
    (None: never; empty: not known). `sensors` is empty where the faults are distinguishable anyway,
    or no sensor would help.
    """

    faults: tuple[str, ...]
    kind: str
    advice: str
    degrees: tuple[float | None, ...] = ()
    sensors: tuple[AdvisedSensor, ...] = ()


@dataclass(frozen=True)
class ParameterSpec:
    """A constant of a module with its origin; value and u in `unit`."""

    id: str
    value: float
    u: float
    unit: str
    origin: str


@dataclass(frozen=True)
class SimulationStep:
    """Readings that follow together from the given ones and from earlier steps.

    `zeros` are signed sums that vanish, as many as `readings`; `flows` gives each flow found in
    this step as a signed sum. Terms are estimates, by observer id, and flows of earlier steps, by
    module.
    """

    readings: tuple[str, ...]
    zeros: tuple[Mapping[str, float], ...]
    flows: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Simulation:
    """How readings are predicted: step by step from those `given`.

    `refused` says why the plant cannot be simulated.
    """

    given: tuple[str, ...]
    steps: tuple[SimulationStep, ...]
    refused: str


@dataclass(frozen=True)
class StateSpec:
    """What a module stores; SI = shown * factor + offset."""

    id: str
    title: str
    unit: str
    factor: float
    offset: float


@dataclass(frozen=True, kw_only=True)
class Dynamics:
    """Balances of a plant that stores.

    The plan reads states by id, `inputs` (readings that are given), `values` (parameters, SI),
    ``x.<fault>`` for each of `faults` (degrees; 0 without the fault), ``error.<reading>`` for each
    of `inputs` (what the sensor adds to the true value; 0 if not given), ``form.<law>`` for each of
    `forms` (what a law adds to its formula, SI; 0 if not given) and ``time``. It gives
    ``der:<state>``, ``start:<state>``, limits ``low:<state>`` and ``high:<state>``, dead times
    ``after:<state>``, ``shown:<signal>`` for each of `outputs`, and ``law:<law>``. `uncertainties`
    are those of `values`, SI, without their correlations; those of `forms` are shares of the law.
    """

    states: tuple[StateSpec, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    faults: tuple[str, ...]
    values: Mapping[str, float]
    uncertainties: Mapping[str, float]
    forms: Mapping[str, float]
    plan: Plan


@dataclass(frozen=True, kw_only=True)
class LiquidSpec:
    """A change of the liquid: a fault of no module that biases estimates of several at once.

    `cells` are as those of other faults, without rules. Where `per_kelvin` (1/K, known to a
    `factor`) is not 0, the property follows the temperature; `thermometers` are the signals that
    measure one. `sign` is that of the change of the property.
    """

    fault: FaultSpec
    cells: tuple[Cell, ...]
    sign: int
    per_kelvin: float
    factor: float
    thermometers: tuple[str, ...]


@dataclass(frozen=True)
class RegimeCondition:
    """A condition of a regime, with its author's `text`.

    With a `signal`, its reading is at or above its minimum (`above`), or below it. Else the plan's
    output ``margin:<margin>`` is significantly positive; its standard uncertainty is
    ``u_margin:<margin>``.
    """

    text: str
    signal: str
    above: bool
    margin: str


@dataclass(frozen=True, kw_only=True)
class RegimeSpec:
    """A way of running that the delivery laws of a module omit, such as dry; all conditions
    hold."""

    id: str
    module: str
    title: str
    text: str
    action: str
    status: str
    when: tuple[RegimeCondition, ...]
    origin: str


@dataclass(frozen=True, kw_only=True)
class KnowledgeSpec:
    """A folder of knowledge that the ruleset is made from.

    `version` is that of the installed package, or empty; `digest` the hash of what was used.
    """

    name: str
    version: str
    digest: str


@dataclass(frozen=True, kw_only=True)
class Ruleset:
    """Everything the runtime needs to judge recordings of one plant.

    `knowledge` is empty if a single folder is the source. `unbalanced` are junctions at modules
    that store: they connect, but flows need not balance. `unlisted` are errors that a reading may
    have beyond those its module lists, with cells of their own: causes beside `faults`. `liquid`
    are changes of the liquid; `undo` gives the observers that they move as ``ql:``, and slopes by
    their degrees as ``dql:``. The ruleset of a part has them among its `faults`, as ``q:`` and
    ``dq:``.
    """

    format_version: int
    plant: str
    title: str
    sources: str
    modules: Mapping[str, str]
    signals: tuple[SignalSpec, ...]
    columns: tuple[ColumnMap, ...]
    time_column: str
    units: Mapping[str, UnitSpec]
    observers: tuple[ObserverSpec, ...]
    junctions: tuple[Junction, ...]
    residuals: tuple[ResidualSpec, ...]
    faults: tuple[FaultSpec, ...]
    cells: tuple[Cell, ...]
    ambiguous: tuple[AmbiguousGroup, ...]
    unobserved: tuple[str, ...]
    parameters: tuple[ParameterSpec, ...]
    simulation: Simulation
    plan: Plan
    undo: Plan
    dynamics: Dynamics | None = field(default=None, metadata=SELDOM)
    time_zone: str = field(default="", metadata=SELDOM)
    file: FileForm = field(default=INFERRED, metadata=SELDOM)
    knowledge: tuple[KnowledgeSpec, ...] = field(default=(), metadata=SELDOM)
    unbalanced: tuple[Junction, ...] = field(default=(), metadata=SELDOM)
    unlisted: tuple[FaultSpec, ...] = field(default=(), metadata=SELDOM)
    unlisted_cells: tuple[Cell, ...] = field(default=(), metadata=SELDOM)
    regimes: tuple[RegimeSpec, ...] = field(default=(), metadata=SELDOM)
    liquid: tuple[LiquidSpec, ...] = field(default=(), metadata=SELDOM)

    @cached_property
    def fault_by_id(self) -> Mapping[str, FaultSpec]:
        """Listed faults, unlisted ones, and changes of the liquid."""
        liquid = (change.fault for change in self.liquid)
        return {f.id: f for f in (*self.faults, *self.unlisted, *liquid)}

    @cached_property
    def is_listed(self) -> np.ndarray:
        """Flags of the faults that some module lists, shape (faults,)."""
        return np.array([not f.unlisted for f in self.faults], dtype=bool)

    @cached_property
    def doubted(self) -> Array:
        """Log prior odds of unlisted faults, 0 for the others, shape (faults,)."""
        return np.where(self.is_listed, 0.0, np.log(self.odds))

    @cached_property
    def moved_by_reading(self) -> Mapping[str, frozenset[str]]:
        """Per signal, the residuals that some unlisted error of its reading moves."""
        cells: dict[str, set[str]] = {}
        for cell in self.unlisted_cells:
            (signal,) = self.fault_by_id[cell.fault].scales
            cells.setdefault(signal, set()).add(cell.residual)
        return {signal: frozenset(moved) for signal, moved in cells.items()}

    def with_unlisted(self) -> Ruleset:
        """The same ruleset with unlisted faults among its faults, the listed ones first."""
        return dataclasses.replace(
            self,
            faults=(*self.faults, *self.unlisted),
            cells=(*self.cells, *self.unlisted_cells),
            unlisted=(),
            unlisted_cells=(),
        )

    @cached_property
    def odds(self) -> Array:
        """Prior odds of the faults, shape (faults,)."""
        return np.array([f.odds for f in self.faults])

    @cached_property
    def observer_by_id(self) -> Mapping[str, ObserverSpec]:
        return {o.id: o for o in self.observers}

    @cached_property
    def read(self) -> frozenset[str]:
        """Signals that an equation reads or predicts."""
        dynamic = self.dynamics
        return self.observed.union(dynamic.inputs + dynamic.outputs if dynamic else ())

    @cached_property
    def observed(self) -> frozenset[str]:
        """Signals that an estimate of a flow reads."""
        return frozenset(s for o in self.observers for s in o.signals)

    @cached_property
    def observer_index(self) -> Mapping[str, int]:
        """Place of each observer in `observers`."""
        return {o.id: i for i, o in enumerate(self.observers)}

    @cached_property
    def signal_by_id(self) -> Mapping[str, SignalSpec]:
        return {s.id: s for s in self.signals}

    @cached_property
    def cells_of_fault(self) -> Mapping[str, tuple[Cell, ...]]:
        found: dict[str, list[Cell]] = {name: [] for name in self.fault_by_id}
        others = (*self.unlisted_cells, *(c for change in self.liquid for c in change.cells))
        for cell in dict.fromkeys((*self.cells, *others)):
            found[cell.fault].append(cell)
        return {name: tuple(cells) for name, cells in found.items()}

    def undone(self, observers: tuple[str, ...], faults: tuple[str, ...]) -> Plan:
        """Plan of flows with faults undone (``q:``), and their slopes by the degrees (``dq:``)."""
        flows = (f"q:{o}" for o in observers)
        slopes = (f"dq:{o}:{f}" for o in observers for f in faults)
        return self._inversion_plan((observers, faults), chain(flows, slopes))

    def undone_slopes(self, observers: tuple[str, ...]) -> Plan:
        """Plan of the slopes (``dq:``) of observers' flows by each degree that moves them."""
        own = frozenset(observers)
        slopes = (f"dq:{o}:{f.id}" for f in self.faults for o in f.affects if o in own)
        return self._inversion_plan(observers, slopes)

    def _inversion_plan(self, key: Any, names: Iterable[str]) -> Plan:
        """The plan cached under a key, or a new one of the names that `undo` has."""
        outputs = (n for n in names if n in self.undo.outputs)
        plans = self.cache.setdefault("undone", {})
        return cached_plan(plans, key, lambda: self.undo.selected(outputs).narrowed())

    @cached_property
    def cache(self) -> dict[str, Any]:
        """Derived results that are worked out once, by names of their users."""
        return {}

    def to_json(self) -> str:
        """The ruleset as text; the same ruleset always gives the same bytes."""
        return self._text

    @cached_property
    def _text(self) -> str:
        """One line per table row: diffs of golden files stay readable.

        It is kept, as a compiled plant is both written and cached for the next start.
        """
        data, lines = _fields(self), []
        for key, value in {**data, DIGEST: digest_of(data, _fields)}.items():
            if isinstance(value, tuple) and value and dataclasses.is_dataclass(value[0]):
                rows = ",\n".join("  " + _dump(row) for row in value)
                lines.append(f"{json.dumps(key)}: [\n{rows}\n]")
            else:
                lines.append(f"{json.dumps(key)}: {_dump(value)}")
        return "{\n" + ",\n".join(lines) + "\n}\n"


def _dump(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, default=_fields)


def _fields(value: Any) -> dict[str, Any]:
    """Fields of a dataclass; `asdict` would copy every operation of a plan."""
    fields = ((f, getattr(value, f.name)) for f in dataclasses.fields(value))
    return {f.name: v for f, v in fields if not (f.metadata.get("seldom") and v == f.default)}
