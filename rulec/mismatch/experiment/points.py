"""Operating points that may be run: within what was recorded or allowed, when, and at what cost."""

from __future__ import annotations

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
from rulec.mismatch.experiment.foretell import Foretold, Places
from rulec.separation.allowed import Allowed


@dataclass(frozen=True)
class Reach:
    """What may be set: by signal the lowest and highest value, SI.

    A step lasts `step`, s, at least. `present` are inputs as they were last, SI; with `allowed`,
    those without a range stay there.
    """

    ranges: Mapping[str, tuple[float, float]]
    step: float
    present: Mapping[str, float] = field(default_factory=dict)
    allowed: Allowed = field(default_factory=lambda: Allowed({}))


def reach_of(
    system: System, recording: Recording, sample: float, allowed: Allowed | None = None
) -> Reach:
    """The ranges that are allowed, or else those of inputs that were changed while recording.

    Steps are as long as they usually were, and so long that readings are seen to settle, with
    samples of `sample`, s.
    """
    present = {
        signal.id: float(known[-1])
        for signal in system.ruleset.signals
        if signal.is_input and signal.id in recording.values
        for known in [recording.values[signal.id][np.isfinite(recording.values[signal.id])]]
        if len(known)
    }
    data = system.data
    steps = np.diff(np.sort(data.time))
    step = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else limits.SHORTEST_STEP
    if not data.of_rows:
        # Inputs that are changed in turn give means closer to each other than a step takes.
        step = max(step, (SETTLING + limits.HELD_SAMPLES) * sample)
    if allowed is None:
        return Reach(dict(_recorded(system)), step, present)
    ranges = {
        name: (min(ends), max(ends))
        for name, own in allowed.inputs.items()
        if name in present
        for ends in [(own.si(own.lowest), own.si(own.highest))]
    }
    return Reach(ranges, step, present, allowed)


def _recorded(system: System) -> Iterator[tuple[str, tuple[float, float]]]:
    """The range of each input that was changed while recording, SI."""
    for signal in system.ruleset.signals:
        values = system.data.values.get(signal.id)
        if not signal.is_input or values is None:
            continue
        # Where a pump stands no equation holds, and nothing between is known to run.
        least = -np.inf if signal.minimum is None else signal.minimum
        ran = values[np.isfinite(values) & (values >= least)]
        noise = float(np.nanmedian(system.data.noise[signal.id]))
        if len(ran) and np.ptp(ran) > limits.FEATURE_VARIES * noise:
            yield signal.id, (float(ran.min()), float(ran.max()))


def places_in(system: System, reach: Reach) -> Places:
    """Points that fill what may be set evenly, its corners among them; the last is the present one.

    Where ranges are allowed ones, values are easy to set, and other inputs stay as they are.
    """
    names = sorted(reach.ranges)
    low, high = np.array([reach.ranges[name] for name in names]).T
    # Of many inputs the ends of the first alone are combined in all ways.
    ends = [(0.0, 1.0) if i < limits.CORNERED else (0.5,) for i in range(len(names))]
    between = qmc.Sobol(len(names), scramble=False).random_base2(limits.PLACES_DOUBLED)
    table = low + np.concatenate([np.array(list(product(*ends))), between]) * (high - low)
    if reach.allowed.inputs:
        for column, name in zip(table.T, names, strict=True):
            column[:] = reach.allowed.inputs[name].easy(column)
        table = table[np.sort(np.unique(table, axis=0, return_index=True)[1])]
        stay = [name for name in sorted(reach.present) if name not in names]
        kept = np.array([reach.present[name] for name in stay])
        names, table = names + stay, np.hstack([table, np.tile(kept, (len(table), 1))])
    table = np.vstack([table, [reach.present[name] for name in names]])
    data = system.data
    # A sensor that fails shows nothing at all.
    shown = [there for v in data.values.values() if (there := np.isfinite(v)).any()]
    usable = np.flatnonzero(np.all(shown, axis=0))
    recorded = np.stack([data.values[name][usable] for name in names], axis=1)
    width = np.maximum(np.maximum(np.ptp(table, axis=0), np.ptp(recorded, axis=0)), 1e-300)
    far = np.abs((table[:, None, :] - recorded[None, :, :]) / width).max(axis=2)
    inputs = dict(zip(names, table.T, strict=True))
    return Places(
        inputs=inputs,
        near=usable[far.argmin(axis=1)],
        time=np.full(len(table), float(data.time.max()) + reach.step),
        around=surroundings(data.values, data.time, _unset(system, names), inputs),
    )


def _unset(system: System, inputs: Sequence[str]) -> tuple[str, ...]:
    """Readings that are neither set nor caused by what is set, as far as any law says."""
    signals = system.ruleset.signal_by_id
    caused = {s for o in system.observers for s in o.signals if not signals[s].is_input}
    return tuple(n for n in system.data.values if n in signals.keys() - caused - set(inputs))


def surroundings(
    recorded: Mapping[str, Array], time: Array, names: Sequence[str], inputs: Mapping[str, Array]
) -> dict[str, Array]:
    """Values of readings that nobody sets at other inputs, shape (n,) each.

    They stay as they were last, but for what of them followed the inputs in the recording, by
    linear least squares: a temperature may follow the load. None leaves what was recorded.
    """
    names = [n for n in names if np.isfinite(recorded[n]).any()]
    usable = np.all([np.isfinite(recorded[n]) for n in (*names, *inputs)], axis=0)
    table = np.stack([recorded[n][usable] for n in inputs], axis=1)
    last = int(np.argmax(time[usable]))
    moved = np.stack(list(inputs.values()), axis=1) - table[last]
    found = {}
    for name in names:
        values = recorded[name][usable]
        off = table - table.mean(axis=0)
        slopes = np.linalg.lstsq(off, values - values.mean(), rcond=1e-6)[0]
        found[name] = np.clip(values[last] + moved @ slopes, values.min(), values.max())
    return found


@dataclass(frozen=True)
class Feasible:
    """Places of which the last is the present one, and what limits say of each.

    `possible`, shape (n,): each explanation foretells it, and no reading leaves its sensor.
    `forbidden` per reading with limits, shape (n,): where it may leave them. `costs` names per
    place the inputs and modules that cost product. `unwatched` are readings with limits that no
    explanation foretells. Each place is held `held` times as long as it has to be at least; the way
    to the first one begins at the place `begun`.
    """

    places: Places
    reach: Reach
    possible: NDArray[np.bool_]
    forbidden: Mapping[str, NDArray[np.bool_]]
    costs: tuple[tuple[str, ...], ...]
    unwatched: tuple[str, ...]
    held: int = 1
    begun: int = -1

    @property
    def may_run(self) -> NDArray[np.bool_]:
        """Places that keep all limits, shape (n,)."""
        leaves = [np.zeros(len(self.possible), dtype=bool), *self.forbidden.values()]
        keeps: NDArray[np.bool_] = self.possible & ~np.any(leaves, axis=0)
        return keeps

    @property
    def free(self) -> NDArray[np.bool_]:
        """Those of them that cost no product, shape (n,)."""
        free: NDArray[np.bool_] = self.may_run & np.array([not costs for costs in self.costs])
        return free

    @property
    def shortest(self) -> float:
        """How long a place is held at least, s."""
        own = self.reach.allowed.inputs.values()
        return max([self.reach.step, *(part.hold for part in own)])

    def times(self, places: Sequence[int]) -> list[tuple[float, float]]:
        """For each of some places in turn, how long the way there takes at least, and how long it
        is held, s."""
        ways = zip([self.begun, *places], places, strict=False)
        hold = self.held * self.shortest
        return [(self._ramp(before, place), hold) for before, place in ways]

    def seconds(self, places: Sequence[int]) -> float:
        """How long some places take in turn, s."""
        return sum(ramp + hold for ramp, hold in self.times(places))

    def _ramp(self, before: int, place: int) -> float:
        allowed = self.reach.allowed.inputs
        ways = {n: self.places.inputs[n] for n in allowed if n in self.places.inputs}
        return max(
            (
                abs(float(v[place] - v[before])) / abs(allowed[n].signal.factor) / allowed[n].rate
                for n, v in ways.items()
            ),
            default=0.0,
        )

    def at_end(self, place: int) -> Iterator[tuple[str, str]]:
        """Inputs that are at an end of what may be set there: its name, and which end."""
        for name in self.reach.ranges:
            values = self.places.inputs[name][:-1]
            value = self.places.inputs[name][place]
            if value in (values.min(), values.max()):
                yield name, "lowest" if value == values.min() else "highest"


def feasible(ruleset: Ruleset, places: Places, reach: Reach, told: Sequence[Foretold]) -> Feasible:
    """What limits say of places, by what each explanation foretells of them."""
    possible = np.ones(len(places), dtype=bool)
    possible[-1] = False
    for true, one in enumerate(told):
        settled = np.zeros(len(places), dtype=bool)
        settled[one.point] = True
        settled[one.point[np.abs(one.off[true]) > limits.FORETOLD_WELL]] = False
        possible &= settled
        for name, values in one.readings.items():
            signal = ruleset.signal_by_id[name]
            low, high = signal.ends
            least = low if signal.minimum is None else max(low, signal.minimum)
            possible &= (values >= least) & (values <= high)
    bounds = reach.allowed.readings
    known = {n: b for n, b in bounds.items() if all(n in one.readings for one in told)}
    return Feasible(
        places=places,
        reach=reach,
        possible=possible,
        forbidden={name: _leaves(told, name, *ends) for name, ends in known.items()},
        costs=_costs(places, reach, told),
        unwatched=tuple(sorted(bounds.keys() - known.keys())),
    )


def _leaves(told: Sequence[Foretold], name: str, low: float, high: float) -> NDArray[np.bool_]:
    """Where a reading may leave its limits under any explanation; so it may where none foretells
    it."""
    values = np.array([one.readings[name] for one in told])
    far = limits.COVERED * np.array([one.spread[name] for one in told])
    keeps: NDArray[np.bool_] = np.all((values - far >= low) & (values + far <= high), axis=0)
    return ~keeps


def _costs(places: Places, reach: Reach, told: Sequence[Foretold]) -> tuple[tuple[str, ...], ...]:
    """Of each place the inputs and modules of which a change from the present point costs product;
    a flow that is not known may change."""
    costly: dict[str, NDArray[np.bool_]] = {}
    for name, own in reach.allowed.inputs.items():
        if own.costs and name in reach.ranges:
            values = places.inputs[name]
            costly[name] = ~np.isclose(values, values[-1], rtol=1e-9, atol=0.0)
    for module in sorted(reach.allowed.costly):
        flows = np.array([one.flows.get(module, np.full(len(places), np.nan)) for one in told])
        same = np.abs(flows - flows[:, -1:]) <= SAME_FLOW * np.abs(flows[:, -1:])
        costly[module] = ~np.all(same, axis=0)
    at = range(len(places))
    return tuple(tuple(n for n, there in costly.items() if there[place]) for place in at)
