"""The recordings of a study: how each is simulated and judged, on any engine.

A *group* is one true plant with one fault, recorded at all operating points and degrees. Its
parameters differ from those of the ruleset within their covariance. The errors of the laws, within
their misfit or accuracy, and of the sensors, within their uncertainty, are new in each recording.
"""

from __future__ import annotations

import pickle
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import lru_cache

import numpy as np
from rulec_runtime.contract.plan import Array, Plan
from rulec_runtime.contract.ruleset import FORM, MISFIT, Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.observe import slope_names
from rulec_runtime.recordings.recording import Recording

from rulec.engines.call import LOCAL, Call, Engine
from rulec.engines.engine import in_order
from rulec.simulation.equations import Equations, equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import Simulated, simulate_with
from rulec.study.points import Points

PARAMETERS, LAWS, SENSORS = range(3)
"""Independent streams of random numbers."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Size of a study.

    There are `seeds` true plants for every fault, each at all degrees and operating points. A
    recording has `samples` with the fault, 1 s apart, after `lead_in` healthy ones. There are
    `healthy` plants without a fault per seed.
    """

    degrees: tuple[float, ...] = (0.1, 0.2, 0.3)
    points: int = 3
    seeds: int = 3
    mode: str = "default"
    lead_in: int = 0
    samples: int = 20
    healthy: int = 20
    errors: SensorErrors = field(default_factory=SensorErrors)


@dataclass(frozen=True)
class Group:
    """One true plant; if it is healthy, `fault` is empty, and `draw` numbers it."""

    fault: str
    seed: int
    draw: int
    truth: Plan

    def random(self, stream: int, *more: int) -> np.random.Generator:
        """Random numbers of this group; they do not depend on the order of the groups."""
        return generator(stream, self.fault, self.seed, self.draw, *more)


def generator(stream: int, fault: str, *numbers: int) -> np.random.Generator:
    """The stream of random numbers for a purpose."""
    return np.random.default_rng([stream, zlib.crc32(fault.encode()), *numbers])


def degrees_of(ruleset: Ruleset, fault: str, settings: Settings) -> tuple[float, ...]:
    """The degrees of a study that a fault can have; 0 for no fault. Degrees with a unit are given
    as shares of the range of their sensor."""
    if not fault:
        return (0.0,)
    spec = ruleset.fault_by_id[fault]
    asked = (d * spec.scale for d in settings.degrees)
    return tuple(d for d in asked if spec.lowest <= d <= spec.highest)


def groups_of(
    ruleset: Ruleset, settings: Settings, draw_truth: Callable[[np.random.Generator], Plan]
) -> Iterator[Group]:
    """All groups of a study; `draw_truth` draws the undo plan of a true plant."""
    for seed in range(settings.seeds):
        cases = [(f.id, 0) for f in ruleset.faults if degrees_of(ruleset, f.id, settings)]
        for fault, draw in [*(("", i) for i in range(settings.healthy)), *cases]:
            random = generator(PARAMETERS, fault, seed, draw)
            yield Group(fault, seed, draw, draw_truth(random))


def run_group(
    ruleset: Ruleset, points: Points, settings: Settings, group: Group
) -> Iterator[Outcome]:
    """Record and judge, one recording after the other."""
    equations = equations_of(replace(ruleset, undo=group.truth))
    degrees, count = degrees_of(ruleset, group.fault, settings), len(points)
    faulty = _simulated(equations, points, group, degrees)
    healthy = _simulated(equations, points, group, (0.0,))
    spec = ruleset.fault_by_id.get(group.fault)
    # The signal whose reading the fault scales; none if it acts on the plant.
    sensor = spec.scales[0] if spec is not None and spec.in_sensor and not spec.unit else ""
    for i, degree in enumerate(np.repeat(degrees, count).tolist()):
        point = i % count
        shown = degree / spec.scale if spec is not None else 0.0
        if not (faulty.solved[i] and healthy.solved[point]):
            yield Outcome(fault=group.fault, degree=shown, kind=Kind.NO_POINT)
            continue
        lengths = (settings.lead_in, settings.samples)
        true = {
            name: np.repeat([healthy.values[name][point], values[i]], lengths)
            for name, values in faulty.values.items()
        }
        random = group.random(SENSORS, point, round(degree * 1e9))
        gains = {name: values / healthy.values[name][point] for name, values in true.items()}
        own = {name: gain for name, gain in gains.items() if name == sensor}
        readings = sense(ruleset, true, settings.errors, random, own)
        yield judge(ruleset, readings, group.fault, shown, settings)


def _simulated(
    equations: Equations, points: Points, group: Group, degrees: tuple[float, ...]
) -> Simulated:
    """Readings without sensor errors at all degrees, and at all points within each."""
    count = len(points)
    given = {name: np.tile(values, len(degrees)) for name, values in points.given.items()}
    fault = {group.fault: np.repeat(degrees, count)} if group.fault else {}
    # The error of a law depends on the operating point, not on the degree.
    off = {name: np.tile(own, len(degrees)) for name, own in _laws_off(equations, points, group)}
    return simulate_with(equations, given, fault, off)


def _laws_off(equations: Equations, points: Points, group: Group) -> Iterator[tuple[str, Array]]:
    """Errors of the laws per observer, m3/s, shape (points,): their misfit, or their form."""
    ruleset, count = equations.ruleset, len(points)
    off = [group.random(LAWS, point) for point in range(count)]
    own = {
        o.id: np.array([o.misfit * random.standard_normal() for random in off])
        for o in ruleset.observers
    }
    names = [n for n in slope_names(ruleset) if n.removesuffix(MISFIT).endswith(FORM)]
    if names:
        everywhere, sizes = group.random(LAWS), dict[str, Array]()
        for form in sorted({n.split(":", 2)[2] for n in names}):
            new = np.array([random.standard_normal() for random in off])
            alike = np.full(count, everywhere.standard_normal())
            sizes[form] = new if form.endswith(MISFIT) else alike
        values = simulate_with(equations, points.given, {}).values
        slopes = ruleset.plan.select(names).run({**values, "u:model": 1.0})
        for name in names:
            _, observer, form = name.split(":", 2)
            own[observer] = own[observer] + np.nan_to_num(slopes[name]) * sizes[form]
    yield from own.items()


def size_of(ruleset: Ruleset, points: Points, settings: Settings) -> tuple[int, int]:
    """Number of faulty and of healthy recordings."""
    cases = sum(len(degrees_of(ruleset, f.id, settings)) for f in ruleset.faults)
    faulty = cases * len(points) * settings.seeds
    return faulty, settings.healthy * len(points) * settings.seeds


Scene = tuple[Ruleset, Points, Settings]
"""What all groups of a study share."""

SCENE = "scene"


def run_groups(
    ruleset: Ruleset,
    points: Points,
    settings: Settings,
    groups: Iterable[Group],
    engine: Engine,
    advance: Callable[[int], None],
) -> list[Outcome]:
    """Outcomes in the order of the groups, for any engine and number of processes.

    `advance` is called with the number of recordings judged since the last call.
    """
    if engine.kind == LOCAL and engine.jobs == 1:
        outcomes = []
        for group in groups:
            for outcome in run_group(ruleset, points, settings, group):
                outcomes.append(outcome)
                advance(1)
        return outcomes
    scene = pickle.dumps((ruleset, points, settings))
    calls = [Call((group,), SCENE) for group in groups]
    found = in_order(engine, run_one, calls, {SCENE: scene}, lambda own: advance(len(own)))
    return [outcome for own in found for outcome in own]


def run_one(group: Group, scene: bytes) -> list[Outcome]:
    """All recordings of a group, in a process of an engine."""
    return list(run_group(*_scene_of(scene), group))


@lru_cache(maxsize=1)
def _scene_of(scene: bytes) -> Scene:
    """The scene of the parent process; unpickled once, as a ruleset caches its derived values."""
    found: Scene = pickle.loads(scene)
    return found


class Kind(StrEnum):
    """The kind of outcome of a recording."""

    NO_POINT = "no operating point"
    NOT_JUDGED = "not judged"
    QUIET = "nothing said"
    UNKNOWN = "nothing known fits"
    NAMED = "named first"
    OTHER = "another named first"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of one recording.

    `fault` is empty in a healthy one. `first` is the fault named first, `shared` whether the true
    one is among the alternatives; `estimate`, `lower`, `upper` are the degree of the finding;
    `early` is a false alarm before the onset of the fault.
    """

    fault: str
    degree: float
    kind: Kind
    first: str = ""
    shared: bool = False
    estimate: float = 0.0
    lower: float = 0.0
    upper: float = 0.0
    early: bool = False


def judge(
    ruleset: Ruleset, readings: Mapping[str, Array], fault: str, degree: float, settings: Settings
) -> Outcome:
    """Diagnose a recording of one sample a second with a fault after the lead-in; its `degree` is a
    share, of what it acts on or of the range of its sensor."""
    onset, samples = settings.lead_in, len(next(iter(readings.values())))
    time, segment = np.arange(float(samples)), np.zeros(samples, dtype=int)
    recording = Recording(time=time, values=readings, segment=segment, missing=(), notes=())
    diagnosis = diagnose(recording, ruleset, settings.mode)
    ends = [f.until for f in diagnosis.findings] + [p.until for p in diagnosis.unknown]
    early = any(end < onset for end in ends)
    late = [f for f in diagnosis.findings if f.until >= onset]
    # The finding that covers most of the time from the onset on.
    finding = max(late, key=lambda f: f.until - max(f.since, onset), default=None)
    if finding is None:
        unknown = any(p.until >= onset for p in diagnosis.unknown)
        kind = Kind.UNKNOWN if unknown else Kind.QUIET if diagnosis.judged else Kind.NOT_JUDGED
        return Outcome(fault=fault, degree=degree, kind=kind, early=early)
    return Outcome(
        fault=fault,
        degree=degree,
        kind=Kind.NAMED if finding.fault.id == fault else Kind.OTHER,
        first=finding.fault.id,
        shared=any(name == fault for name, _ in finding.alternatives),
        estimate=finding.degree / finding.fault.scale,
        lower=finding.lower / finding.fault.scale,
        upper=finding.upper / finding.fault.scale,
        early=early,
    )
