"""A true plant: parameters drawn from their uncertainties, explanations built in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import systematic_u

from rulec.algebra.graph import Graph
from rulec.effects.candidate import TIME, Candidate, Unknown
from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate
from tests.rig.mismatch.planted.course import RIGS

STATISTICAL = SensorErrors().statistical

TRIES = 12
"""Steps to find the size of an effect."""


@cache
def opened(plant: str) -> tuple[Ruleset, ModelBuilder]:
    """A plant compiled, once per process."""
    return open_builder(RIGS[plant].file)


@dataclass(frozen=True)
class Built:
    """A plant as it truly is; `values` of parameters and unknowns, `joined` what is built in.

    `given` are courses, shape (n,), of signals, of the clock and of unknowns that vary.
    """

    plant: str
    joined: tuple[Candidate, ...]
    values: Mapping[str, float]
    given: Mapping[str, Array]

    def readings(self, every: int = 1) -> dict[str, Array]:
        """What perfect sensors show, of every so-manyth sample; NaN where nothing solves."""
        ruleset, builder = opened(self.plant)
        given = {name: v[::every] for name, v in self.given.items()}
        undo = _graph(ruleset, builder, self).plan()
        extra = [name for name in undo.inputs if name not in ruleset.signal_by_id]
        signals = (*ruleset.signals, *(_stranger(name, given[name]) for name in extra))
        drivers = {*undo.inputs, *ruleset.simulation.given} & set(given)
        known = [s for s in signals if s.id in drivers]
        signals = tuple(
            replace(s, reference=float(np.median(given[s.id])))
            if s in known and s.id not in ruleset.simulation.given
            else s
            for s in signals
        )
        steps = replace(ruleset.simulation, given=tuple(s.id for s in known))
        true = replace(ruleset, signals=signals, undo=undo, simulation=steps)
        found = simulate(true, {s.id: given[s.id] for s in known}, {})
        own = ruleset.signal_by_id
        return {**{n: v for n, v in given.items() if n in own}} | {
            n: np.where(found.solved, v, np.nan) for n, v in found.values.items() if n in own
        }


def _stranger(name: str, values: Array) -> SignalSpec:
    """Something that is given and no signal: the clock, or a degree that comes and goes."""
    middle = float(np.median(values))
    return SignalSpec(
        id=name,
        title=name,
        unit="1",
        factor=1.0,
        offset=0.0,
        kind="value",
        standard=0.0,
        full_scale=None,
        lowest=None,
        highest=None,
        minimum=None,
        valid_from=None,
        valid_to=None,
        is_input=True,
        reference=middle,
    )


def _graph(ruleset: Ruleset, builder: ModelBuilder, built: Built) -> Graph:
    """All observers in one graph, with numbers for all that does not vary."""
    ids = tuple(c.id for c in built.joined)
    plans = [builder.plan(m, ids) for m in dict.fromkeys(o.module for o in ruleset.observers)]
    names = dict.fromkeys(name for plan in plans for name in plan.inputs)
    varying = [n for n in names if n in ruleset.signal_by_id or n in built.given]
    graph = Graph(varying)
    for plan in plans:
        nodes = [
            graph.input(name) if name in set(varying) else graph.constant(built.values[name])
            for name in plan.inputs
        ]
        nodes += [graph.constant(value) for value in plan.constants]
        for name, a, b in plan.operations:
            nodes.append(graph.apply(name, nodes[a], nodes[b]))
        for output, number in plan.outputs.items():
            if output.startswith("q:"):
                graph.outputs[output] = nodes[number]
    return graph


def drawn(plant: str, random: np.random.Generator) -> dict[str, float]:
    """Parameters of a plant from their covariance, and its constants; SI."""
    base = opened(plant)[1].parameters
    u = np.sqrt(np.diag(base.covariance))
    correlation = base.covariance / np.outer(np.maximum(u, 1e-300), np.maximum(u, 1e-300))
    root = np.linalg.cholesky(correlation + 1e-9 * np.eye(len(u)))
    shifted = base.values + u * (root @ random.standard_normal(len(u)))
    return {**base.constants, **dict(zip(base.ids, shifted.tolist(), strict=True))}


def with_term(
    built: Built, candidate: Candidate, strength: float, random: np.random.Generator
) -> tuple[Built, float]:
    """Build an explanation in, so large that it shows as often the noise of some reading.

    Returns the plant and the strength that was reached: the end of a range may stop it.
    """
    every = 5
    plain = replace(built).readings(every)
    reference = built.readings(1) if any(u.null is None for u in candidate.unknowns) else {}
    shapes = {
        u.id: _shape(built, reference, u, random) for u in candidate.unknowns if u.null is None
    }
    (unknown,) = (u for u in candidate.unknowns if u.null is not None)
    assert unknown.null is not None
    sign, size = _direction(candidate, unknown, random)
    reached = 0.0
    now = built
    for _ in range(TRIES):
        # The end of a range belongs to another law.
        low, high = (0.9 * (end - unknown.null) for end in (unknown.lowest, unknown.highest))
        value = unknown.null + min(max(sign * size, low), high)
        values = {**built.values, **shapes, unknown.id: value}
        now = replace(built, joined=(*built.joined, candidate), values=values)
        reached = _shown(built.plant, plain, now.readings(every))
        if not np.isfinite(reached):
            size /= 4.0
            continue
        if abs(reached / strength - 1.0) < 0.03:
            break
        size = abs(value - unknown.null) * float(np.clip(strength / max(reached, 1e-12), 1e-3, 1e3))
    return now, reached


def _direction(
    candidate: Candidate, unknown: Unknown, random: np.random.Generator
) -> tuple[float, float]:
    """Sign and first size of an amplitude."""
    start = unknown.starts[int(random.integers(len(unknown.starts)))]
    null = unknown.null or 0.0
    sign = float(np.sign(start - null))
    both = unknown.lowest < null < unknown.highest
    if candidate.sort == "sensor" and both:
        sign = float(random.choice([-1.0, 1.0]))
    return sign, abs(start - null)


def _shape(
    built: Built, readings: Mapping[str, Array], unknown: Unknown, random: np.random.Generator
) -> float:
    """A parameter that only shapes a term: as a search would try it, but between the tries."""
    name = unknown.driver
    values = None
    if name is not None:
        values = built.given[TIME] if name == TIME else readings[name]
        values = values[np.isfinite(values)]
    if unknown.fixed:
        assert values is not None
        return float(np.median(values))
    if values is not None and unknown.quantiles:
        ends = min(unknown.quantiles), max(unknown.quantiles)
        quantile = random.uniform(ends[0], min(ends[1], 0.85))
        return float(np.quantile(values, quantile))
    start = unknown.starts[int(random.integers(len(unknown.starts)))]
    if unknown.id.endswith(".tau"):
        start = random.uniform(0.15, 0.5) * float(np.ptp(built.given[TIME]))
    return float(np.clip(start * random.uniform(0.8, 1.25), unknown.lowest, unknown.highest))


def _shown(plant: str, plain: Mapping[str, Array], other: Mapping[str, Array]) -> float:
    """Root mean square of a change over the noise of a sample, of the reading that shows it most.

    NaN where a tenth of the samples has no solution.
    """
    signals = opened(plant)[0].signal_by_id
    largest = 0.0
    for name, before in plain.items():
        known = np.isfinite(before)
        if np.isfinite(other[name])[known].mean() < 0.9:
            return float("nan")
        noise = STATISTICAL * systematic_u(signals[name], before)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(noise > 0, (other[name] - before) / noise, 0.0)
        largest = max(largest, float(np.sqrt(np.nanmean(ratio**2))))
    return largest


def recorded(built: Built, random: np.random.Generator, without: Sequence[str] = ()) -> Recording:
    """The plant as its sensors show it; samples without solution are left out."""
    ruleset = opened(built.plant)[0]
    values = built.readings()
    sound = np.all([np.isfinite(v) for v in values.values()], axis=0)
    shown = sense(ruleset, values, SensorErrors(), random)
    kept = {n: np.where(sound, v, np.nan) for n, v in shown.items() if n not in without}
    time = built.given[TIME]
    used = {s for o in ruleset.observers for s in o.signals}
    missing = tuple(s.id for s in ruleset.signals if s.id in used and s.id not in kept)
    return Recording(time=time, values=kept, segment=np.zeros(len(time)), missing=missing, notes=())
