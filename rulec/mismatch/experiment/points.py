"""Feasible operating points: within what was recorded or allowed, when, and at what cost."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.limits import SETTLING
from rulec_runtime.recordings.recording import Recording
from scipy.stats import qmc

from rulec.limits import SAME_FLOW
from rulec.mismatch import limits
from rulec.mismatch.evidence.steady.system import System
from rulec.mismatch.experiment.forecast import Forecast, SetPoints
from rulec.separation.allowed import Allowed


@dataclass(frozen=True)
class InputRanges:
    """The range of each input, SI.

    A step lasts at least `step`, s. `present` are the last values of inputs, SI; with `allowed`,
    inputs without a range keep them.
    """

    bounds: Mapping[str, tuple[float, float]]
    step: float
    present: Mapping[str, float] = field(default_factory=dict)
    allowed: Allowed = field(default_factory=lambda: Allowed({}))


def input_ranges(
    system: System, recording: Recording, sample: float, allowed: Allowed | None = None
) -> InputRanges:
    """The allowed ranges, else the ranges of inputs that varied in the recording.

    Steps are as long as usual, and long enough for readings to settle, with samples of `sample`, s.
    """
    inputs = [s for s in system.ruleset.signals if s.is_input]
    recorded = {s.id: recording.values[s.id] for s in inputs if s.id in recording.values}
    recorded = {name: values[np.isfinite(values)] for name, values in recorded.items()}
    present = {name: float(values[-1]) for name, values in recorded.items() if len(values)}
    data = system.data
    step = usual_step(np.sort(data.time))
    if not data.of_rows:
        # If inputs change one after another, means are closer to each other than a step takes.
        step = max(step, (SETTLING + limits.HELD_SAMPLES) * sample)
    ranges: dict[str, tuple[float, float]] = {}
    if allowed is not None:
        for name, own in allowed.inputs.items():
            if name in present:
                low, high = sorted((own.si(own.lowest), own.si(own.highest)))
                ranges[name] = (low, high)
        return InputRanges(ranges, step, present, allowed)
    for signal in (s for s in inputs if s.id in data.values):
        values = data.values[signal.id]
        # No equation holds where a pump stands, and whether values between can run is unknown.
        least = -np.inf if signal.minimum is None else signal.minimum
        ran = values[np.isfinite(values) & (values >= least)]
        noise = float(np.nanmedian(data.noise[signal.id]))
        if len(ran) and np.ptp(ran) > limits.FEATURE_VARIES * noise:
            ranges[signal.id] = (float(ran.min()), float(ran.max()))
    return InputRanges(ranges, step, present)


def usual_step(time: Array) -> float:
    """The usual time between two points in time, s; shape (n,)."""
    steps = np.diff(time)
    steps = steps[steps > 0.0]
    return float(np.median(steps)) if len(steps) else limits.SHORTEST_STEP


def points_in(system: System, ranges: InputRanges) -> SetPoints:
    """Points that fill the ranges evenly, including corners; the last one is the present point.

    For allowed ranges, values are easy to set, and other inputs stay as they are.
    """
    names = sorted(ranges.bounds)
    low, high = np.array([ranges.bounds[name] for name in names]).T
    # Of many inputs, only the ends of the first ones are combined in all ways.
    ends = [(0.0, 1.0) if i < limits.CORNERED else (0.5,) for i in range(len(names))]
    between = qmc.Sobol(len(names), scramble=False).random_base2(limits.PLACES_DOUBLED)
    table = low + np.concatenate([np.array(list(product(*ends))), between]) * (high - low)
    if ranges.allowed.inputs:
        for column, name in zip(table.T, names, strict=True):
            column[:] = ranges.allowed.inputs[name].easy(column)
        table = table[np.sort(np.unique(table, axis=0, return_index=True)[1])]
        stay = [name for name in sorted(ranges.present) if name not in names]
        constant = np.array([ranges.present[name] for name in stay])
        names, table = names + stay, np.hstack([table, np.tile(constant, (len(table), 1))])
    table = np.vstack([table, [ranges.present[name] for name in names]])
    data = system.data
    # Points with the most readings: a sensor may have failed, or is not in every recording.
    finite = np.all([np.isfinite(data.values[name]) for name in names], axis=0)
    shown = finite * np.sum([np.isfinite(v) for v in data.values.values()], axis=0)
    usable = np.flatnonzero(shown == shown.max())
    recorded = np.stack([data.values[name][usable] for name in names], axis=1)
    width = np.maximum(np.maximum(np.ptp(table, axis=0), np.ptp(recorded, axis=0)), 1e-300)
    far = np.abs((table[:, None, :] - recorded[None, :, :]) / width).max(axis=2)
    inputs = dict(zip(names, table.T, strict=True))
    # Readings that are neither set nor, by any law, depend on what is set.
    signals = system.ruleset.signal_by_id
    caused = {s for o in system.observers for s in o.signals if not signals[s].is_input}
    unset = [n for n in data.values if n in signals.keys() - caused - set(names)]
    return SetPoints(
        inputs=inputs,
        near=usable[far.argmin(axis=1)],
        time=np.full(len(table), float(data.time.max()) + ranges.step),
        around=surroundings(data.values, data.time, unset, inputs),
    )


def surroundings(
    recorded: Mapping[str, Array], time: Array, names: Sequence[str], inputs: Mapping[str, Array]
) -> dict[str, Array]:
    """Values at other inputs of readings that are not set, shape (n,) each.

    They keep their last value except for the part that followed the inputs in the recording, by
    linear least squares: a temperature may follow the load. All stay within the recorded range.
    """
    finite, found = np.all([np.isfinite(recorded[n]) for n in inputs], axis=0), {}
    for name in names:
        usable = finite & np.isfinite(recorded[name])
        if not usable.any():
            continue
        values = recorded[name][usable]
        table = np.stack([recorded[n][usable] for n in inputs], axis=1)
        off, last = table - table.mean(axis=0), int(np.argmax(time[usable]))
        moved = np.stack(list(inputs.values()), axis=1) - table[last]
        slopes = np.linalg.lstsq(off, values - values.mean(), rcond=1e-6)[0]
        found[name] = np.clip(values[last] + moved @ slopes, values.min(), values.max())
    return found


@dataclass(frozen=True)
class Feasible:
    """Points, the last of which is the present one, and what limits say of each.

    `possible`, shape (n,): each explanation predicts it, and no reading leaves its sensor's range.
    `forbidden` per reading with limits, shape (n,): where it may leave them. `costs` names per
    point the inputs and modules that cost product. `unwatched` are readings with limits that no
    explanation predicts. Each point is held `held` times as long as necessary; the way to the first
    one begins at the point `begun`.
    """

    points: SetPoints
    ranges: InputRanges
    possible: NDArray[np.bool_]
    forbidden: Mapping[str, NDArray[np.bool_]]
    costs: tuple[tuple[str, ...], ...]
    unwatched: tuple[str, ...]
    held: int = 1
    begun: int = -1

    @property
    def may_run(self) -> NDArray[np.bool_]:
        """Points that keep all limits, shape (n,)."""
        leaves = [np.zeros(len(self.possible), dtype=bool), *self.forbidden.values()]
        return np.asarray(self.possible & ~np.any(leaves, axis=0))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Points that also cost no product, shape (n,)."""
        return np.asarray(self.may_run & np.array([not costs for costs in self.costs]))

    @property
    def shortest(self) -> float:
        """The shortest time to hold a point, s."""
        return max([self.ranges.step, *(part.hold for part in self.ranges.allowed.inputs.values())])

    def times(self, numbers: Sequence[int]) -> list[tuple[float, float]]:
        """The shortest time of the way to each point in sequence, and that of holding it, s."""
        route, ramps = [self.begun, *numbers], np.zeros(len(numbers))
        for name, own in self.ranges.allowed.inputs.items():
            if name in self.points.inputs:
                way = np.abs(np.diff(self.points.inputs[name][route]))
                ramps = np.maximum(ramps, way / abs(own.signal.factor) / own.rate)
        return [(ramp, self.held * self.shortest) for ramp in ramps.tolist()]

    def seconds(self, numbers: Sequence[int]) -> float:
        """The time that some points take in sequence, s."""
        return sum(ramp + hold for ramp, hold in self.times(numbers))

    def at_end(self, number: int) -> Iterator[tuple[str, str]]:
        """Inputs that are at an end of their range at a point: name, and which end."""
        for name in self.ranges.bounds:
            values = self.points.inputs[name][:-1]
            value = self.points.inputs[name][number]
            if value in (values.min(), values.max()):
                yield name, "lowest" if value == values.min() else "highest"


def feasible(
    ruleset: Ruleset, points: SetPoints, ranges: InputRanges, predicted: Sequence[Forecast]
) -> Feasible:
    """What limits say of points, by the predictions of each explanation."""
    possible = np.ones(len(points), dtype=bool)
    possible[-1] = False
    for true, one in enumerate(predicted):
        settled = np.zeros(len(points), dtype=bool)
        settled[one.point] = True
        settled[one.point[np.abs(one.off[true]) > limits.FORETOLD_WELL]] = False
        possible &= settled
        for name, values in one.readings.items():
            signal = ruleset.signal_by_id[name]
            low, high = signal.ends
            least = low if signal.minimum is None else max(low, signal.minimum)
            possible &= (values >= least) & (values <= high)
    bounds = ranges.allowed.readings
    predictable = [n for n in bounds if all(n in one.readings for one in predicted)]
    forbidden = {}
    for name in predictable:
        # Where a reading may leave its limits by some explanation, or is not predicted.
        values = np.array([one.readings[name] for one in predicted])
        far = limits.COVERED * np.array([one.spread[name] for one in predicted])
        inside = (values - far >= bounds[name][0]) & (values + far <= bounds[name][1])
        forbidden[name] = ~np.asarray(inside.all(axis=0))
    costly: dict[str, NDArray[np.bool_]] = {}
    for name, own in ranges.allowed.inputs.items():
        if own.costs and name in ranges.bounds:
            values = points.inputs[name]
            costly[name] = ~np.isclose(values, values[-1], rtol=1e-9, atol=0.0)
    for module in sorted(ranges.allowed.costly):
        # An unknown flow counts as changed.
        unknown = np.full(len(points), np.nan)
        flows = np.array([one.flows.get(module, unknown) for one in predicted])
        same = np.abs(flows - flows[:, -1:]) <= SAME_FLOW * np.abs(flows[:, -1:])
        costly[module] = ~np.all(same, axis=0)
    return Feasible(
        points=points,
        ranges=ranges,
        possible=possible,
        forbidden=forbidden,
        costs=tuple(
            tuple(n for n, there in costly.items() if there[i]) for i in range(len(points))
        ),
        unwatched=tuple(sorted(bounds.keys() - set(predictable))),
    )
