"""The ruleset: what the compiler hands to the runtime. Data only, SI inside."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np

from rulec_runtime import limits
from rulec_runtime.contract.file_form import AS_SEEN, FileForm
from rulec_runtime.contract.plan import Array, Plan, kept_plan
from rulec_runtime.output.json_file import DIGEST, digest_of

Size = TypeVar("Size", float, Array)

FORMAT_VERSION = 3


MISFIT = "~"
"""Mark behind an observer's id: its own misfit as an input of gradients."""

UNCERTAINTIES = ("full scale", "reading", "value")
"""What the systematic uncertainty of a sensor is a share of, or a value."""


USUAL = "usual"
"""How often a fault comes of which nothing is said; the words are those of `FREQUENCY_ODDS`."""


SELDOM = {"seldom": True}
"""Mark of a field that stands in a file only where it has another value than its default."""


@dataclass(frozen=True, kw_only=True)
class SignalSpec:
    """A measured value: SI = reading * factor + offset.

    `kind` and `standard` give the systematic standard uncertainty (a share of full scale or of
    the reading, or a value in SI). `valid_from`, `valid_to` bound the range in which the equations
    were calibrated; below `minimum` nothing is judged. `between` samples a given reading keeps its
    value (``hold``) or runs straight to the next (``line``).
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
        """What its sensor can show, SI; without bound where nothing is known of it."""
        low, high = self.lowest, self.highest
        return -math.inf if low is None else low, math.inf if high is None else high

    def shown(self, value: Size) -> Size:
        """A value, SI, or several, as the sensor shows it, in its own unit."""
        return (value - self.offset) / self.factor


@dataclass(frozen=True)
class ColumnMap:
    """A column of a foreign file; SI = value * factor + offset."""

    signal: str
    column: str
    factor: float
    offset: float


@dataclass(frozen=True)
class UnitSpec:
    """A unit a recording may be written in; `dimension` are exponents of m, kg, s, K, A."""

    factor: float
    offset: float
    dimension: tuple[float, ...]


@dataclass(frozen=True)
class Guard:
    """A plan output that must be positive, and how to say so."""

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
    """Flows balance here: those that leave `outlets` enter `inlets`."""

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

    `affects` lists the observers that it makes wrong, `scales` the signals in what it scales: only
    these may leave the calibrated range because of the fault. `in_sensor` says that the reading
    itself is scaled, errors and all; else the quantity, and so the errors of estimates of it.
    With a `unit` the degree is a size that is added to the reading; else it is a share.
    `frequency` says how often it comes beside other faults, as `frequency_origin` has it. Nobody
    would believe a degree from `absurd` on, where that is below `highest`. An `unlisted` one
    may be in any reading of its class: no module lists it, and no rule gives its degree.
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
        """Degree below which one is believed; at the end of its range whatever is wrong piles
        up."""
        end = self.highest * (1.0 - limits.END_OF_RANGE)
        return end if self.absurd is None else min(end, self.absurd)

    @property
    def scale(self) -> float:
        """Degrees over this are shares: of what it acts on, or of the range of its sensor."""
        return self.highest if self.unit else 1.0

    @property
    def odds(self) -> float:
        """Prior odds of it, over a listed fault that comes as usual."""
        listed = limits.UNLISTED_ODDS if self.unlisted else 1.0
        return listed * limits.FREQUENCY_ODDS[self.frequency]


@dataclass(frozen=True)
class Cell:
    """A non-zero entry of the fault-symptom matrix at the reference point.

    `gain` is dR/dg (g: what the fault scales), `sensitivity` dR/dx in m3/s per unit of degree,
    `detectable` the degree at which the residual leaves its threshold. `forms` lists the rule
    forms that the plan holds as ``x:<form>:<fault>:<residual>``: none of an unlisted fault.
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
    """Faults that are hard or impossible to tell apart, and the sensors that would help.

    `degrees`, per fault, are those from which on it is told from the others at one operating
    point (None: never; empty: not known); `sensors` is empty where they are told apart anyway, or
    no sensor would help.
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
    """Readings that follow together from given ones and from earlier steps.

    `zeros` are signed sums that vanish, as many as `readings`; `flows` gives each flow that is
    found here as a signed sum. Terms are estimates, by observer id, and flows of earlier steps, by
    module.
    """

    readings: tuple[str, ...]
    zeros: tuple[Mapping[str, float], ...]
    flows: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Simulation:
    """How readings are predicted: step by step from those `given`.

    Where the plant cannot be simulated, `refused` says why.
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
    ``x.<fault>`` for each of `faults` (degrees; 0 without the fault) and ``time``; it gives
    ``der:<state>``, ``start:<state>``, limits ``low:<state>`` and ``high:<state>``, dead
    times ``after:<state>``, and ``shown:<signal>`` for each of `outputs`. `uncertainties` are those
    of `values`, SI, without their correlations.
    """

    states: tuple[StateSpec, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    faults: tuple[str, ...]
    values: Mapping[str, float]
    uncertainties: Mapping[str, float]
    plan: Plan


@dataclass(frozen=True, kw_only=True)
class LiquidSpec:
    """A change of the liquid: a fault of no module, which makes estimates of several wrong at once.

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
    """A condition of a regime, `text` as its author wrote it.

    With a `signal` its reading is not below its minimum (`above`), or below it. Else the plan's
    output ``margin:<margin>`` is positive beyond ``u_margin:<margin>``, its standard uncertainty.
    """

    text: str
    signal: str
    above: bool
    margin: str


@dataclass(frozen=True, kw_only=True)
class RegimeSpec:
    """A way in which a module runs that its laws for delivering do not cover, such as dry; all
    conditions must hold."""

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

    `version` is that of the installed package, or empty; `digest` the hash of what was taken.
    """

    name: str
    version: str
    digest: str


@dataclass(frozen=True, kw_only=True)
class Ruleset:
    """Everything the runtime needs to judge recordings of one plant.

    `knowledge` is empty where it comes from one folder alone. `unbalanced` are junctions at modules
    that store: what meets there is connected, and no flows balance. `unlisted` are errors that a
    reading may have whatever its module lists, with cells of their own: causes beside `faults`.
    `liquid` are changes of the liquid; `undo` gives the observers that they move as ``ql:``, and
    slopes by their degrees as ``dql:``. The ruleset of a part has them among its `faults`, as
    ``q:`` and ``dq:``.
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
    file: FileForm = field(default=AS_SEEN, metadata=SELDOM)
    knowledge: tuple[KnowledgeSpec, ...] = field(default=(), metadata=SELDOM)
    unbalanced: tuple[Junction, ...] = field(default=(), metadata=SELDOM)
    unlisted: tuple[FaultSpec, ...] = field(default=(), metadata=SELDOM)
    unlisted_cells: tuple[Cell, ...] = field(default=(), metadata=SELDOM)
    regimes: tuple[RegimeSpec, ...] = field(default=(), metadata=SELDOM)
    liquid: tuple[LiquidSpec, ...] = field(default=(), metadata=SELDOM)

    @cached_property
    def fault_by_id(self) -> Mapping[str, FaultSpec]:
        """Those that are listed, and the others."""
        liquid = (change.fault for change in self.liquid)
        return {f.id: f for f in (*self.faults, *self.unlisted, *liquid)}

    @cached_property
    def is_listed(self) -> np.ndarray:
        """Which faults some module lists, flags of the shape (faults,)."""
        return np.array([not f.unlisted for f in self.faults], dtype=bool)

    @cached_property
    def doubted(self) -> Array:
        """Logarithm of the prior odds of the faults that no module lists, 0 of the others, shape
        (faults,)."""
        return np.where(self.is_listed, 0.0, np.log(self.odds))

    @cached_property
    def moved_by_reading(self) -> Mapping[str, frozenset[str]]:
        """Residuals that some unlisted error of a reading moves, by the signal."""
        cells: dict[str, set[str]] = {}
        for cell in self.unlisted_cells:
            (signal,) = self.fault_by_id[cell.fault].scales
            cells.setdefault(signal, set()).add(cell.residual)
        return {signal: frozenset(moved) for signal, moved in cells.items()}

    def with_unlisted(self) -> Ruleset:
        """The same ruleset with all that may be wrong among its faults, the listed ones first."""
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
        """Signals that some equation reads or predicts."""
        dynamic = self.dynamics
        return self.observed.union(dynamic.inputs + dynamic.outputs if dynamic else ())

    @cached_property
    def observed(self) -> frozenset[str]:
        """Signals that some estimate of a flow reads."""
        return frozenset(s for o in self.observers for s in o.signals)

    @cached_property
    def misfits(self) -> frozenset[str]:
        """Inputs of gradients that are an observer's own misfit: new at every operating point."""
        return frozenset(f"{o.id}{MISFIT}" for o in self.observers)

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

        def made() -> Plan:
            names = [f"q:{o}" for o in observers]
            return self._of_undo([*names, *(f"dq:{o}:{f}" for o in observers for f in faults)])

        return kept_plan(self._undone, (observers, faults), made)

    def undone_slopes(self, observers: tuple[str, ...]) -> Plan:
        """Plan of the slopes (``dq:``) of the flows of observers by each degree that moves them."""

        def made() -> Plan:
            own = frozenset(observers)
            return self._of_undo(
                f"dq:{o}:{f.id}" for f in self.faults for o in f.affects if o in own
            )

        return kept_plan(self._undone, observers, made)

    def _of_undo(self, names: Iterable[str]) -> Plan:
        """Those of some outputs of `undo` that there are."""
        return self.undo.selected(n for n in names if n in self.undo.outputs).narrowed()

    @cached_property
    def kept(self) -> dict[str, Any]:
        """What those who read it have worked out of it once, by names of their own."""
        return {}

    @cached_property
    def _undone(self) -> dict[Any, Plan]:
        return {}

    def to_json(self) -> str:
        """The ruleset as text; the same ruleset always gives the same bytes."""
        return self._text

    @cached_property
    def _text(self) -> str:
        # Who compiles a plant keeps it for the next start, and writes it.
        data = _fields(self)
        return _write({**data, DIGEST: digest_of(data, _fields)})


def _write(data: dict[str, Any]) -> str:
    """One line per table row: diffs of golden files stay readable."""
    lines = []
    for key, value in data.items():
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
