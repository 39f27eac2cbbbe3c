"""Simulations of the models of one plant over one recording."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.columns import filled, glitches_in, resolution, thinned
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.robust_statistics import Flags, white_noise
from rulec_runtime.recordings.standing_still import standing_still
from rulec_runtime.report.text import counted, fixed
from rulec_runtime.simulation.balances import TIME, Balances, Course

from rulec.effects.candidate import BaseParameters, Candidate, DisturbanceLocation, Unknown
from rulec.effects.model_builder import ModelBuilder
from rulec.knowledge.parameter_belief import Belief
from rulec.mismatch import limits as common
from rulec.mismatch.evidence import limits
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.failing_sensors import step_of_display
from rulec.mismatch.evidence.model import (
    ESTIMATION,
    HELD_OUT,
    HELDOUT,
    PATTERN,
    SEARCHED,
    SELECTION,
    Samples,
    counted_rows,
    digest_of,
    inside_of,
    unread,
)
from rulec.mismatch.evidence.prior import Prior, belief_of, prior_with
from rulec.mismatch.result import Evidence


@dataclass(frozen=True, kw_only=True)
class Record(Samples):
    """Samples in order of time.

    `inputs` are finite, `measured` readings are NaN where there is none; both have an array of
    shape (n,), SI, per signal. `resolution` is the smallest step of a reading, `glitches` the
    number of removed readings, per signal. For the rows of the recording, shape (rows,), `sample`
    is the number of the sample that includes each, or -1; `read` flags rows with a usable reading
    of a predicted signal, `odd` those with a removed one.
    """

    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]
    resolution: Mapping[str, float]
    glitches: Mapping[str, int]
    sample: NDArray[np.intp]
    read: Flags
    odd: Flags

    @property
    def thinning(self) -> int:
        """Number of rows of the recording in each sample."""
        return int(np.count_nonzero(self.sample == 0))


def record_of(
    recording: Recording,
    ruleset: Ruleset,
    given: Sequence[str],
    heldout: Sequence[tuple[float, float]] = (),
) -> Record | None:
    """Prepare a recording; None where an input, or every predicted reading, is missing.

    Parameters
    ----------
    given : signals that no equation predicts.
    """
    dynamics = ruleset.dynamics
    assert dynamics is not None
    values, signals = recording.values, ruleset.signal_by_id
    whole = {n: without_odd(signals[n], values[n]) for n in dynamics.outputs if n in values}
    strange = {n: np.isfinite(values[n]) & ~np.isfinite(v) for n, v in whole.items()}
    rows, factor = np.arange(len(recording)), max(-(-len(recording) // common.SAMPLE_BUDGET), 1)
    inputs = {n: v for n, v in values.items() if n in given}
    time, inputs, measured = thinned(recording.time, inputs, whole, factor)
    inputs = {n: filled(v) for n, v in inputs.items() if np.isfinite(v).any()}
    if any(n not in inputs for n in dynamics.inputs) or len(time) < common.BLOCKS:
        return None
    part = _split(time, inputs, heldout)
    open_ = part != HELDOUT
    measured = {n: v for n, v in measured.items() if np.isfinite(v[open_]).sum() > common.BLOCKS}
    if not measured:
        return None
    return Record(
        time=time,
        inputs=inputs,
        measured=measured,
        resolution={n: _resolution(values[n], signals[n]) for n in measured},
        glitches={n: int(flags.sum()) for n, flags in strange.items()},
        part=part,
        split=_split_in_words(time, part, heldout),
        digest=digest_of(time, part),
        sample=np.where(rows < len(time) * factor, rows // factor, -1),
        read=np.any([np.isfinite(whole[n]) for n in measured], axis=0),
        odd=np.any([strange[n] for n in measured], axis=0),
        timed=recording.one_clock,
    )


def without_odd(signal: SignalSpec, values: Array) -> Array:
    """Readings without outliers and stuck ones, shape (n,)."""
    odd = glitches_in(values)
    for first, behind in standing_still(values, ends=(signal.lowest, signal.highest)):
        odd[first + 1 : behind] = True
    return np.where(odd, np.nan, values)


def _resolution(values: Array, signal: SignalSpec) -> float:
    """Standard deviation by the steps of a reading."""
    step = step_of_display(signal, values)
    return step / float(np.sqrt(12.0)) or resolution(values, signal)


def stored_evidence(recording: Recording, record: Record) -> tuple[Evidence, ...]:
    """Count the rows of a recording by their use."""
    used: list[str] = []
    unused = unread(recording)
    rows = zip(record.sample.tolist(), record.read.tolist(), record.odd.tolist(), strict=True)
    for sample, there, strange in rows:
        if sample < 0:
            unused.append("too few rows at the end for a mean")
        elif there:
            what = HELD_OUT if record.part[sample] == HELDOUT else SEARCHED
            used.append(f"{what}; a reading is set aside" if strange else what)
        elif strange:
            unused.append("readings stand still, or jump for one row")
        else:
            unused.append("no reading to compare with; the simulation runs through")
    return counted_rows(used, unused)


def lacking(recording: Recording, ruleset: Ruleset) -> str:
    """Explain to users why `record_of` finds nothing to compare."""
    dynamics = ruleset.dynamics
    assert dynamics is not None

    def absent(names: Sequence[str]) -> list[str]:
        values = recording.values
        return [n for n in names if n not in values or not np.isfinite(values[n]).any()]

    if given := absent(dynamics.inputs):
        return f"{', '.join(given)} drives the plant and is not in the recording"
    if len(absent(dynamics.outputs)) == len(dynamics.outputs):
        return f"it needs a reading of {' or '.join(dynamics.outputs)}; the recording has none"
    fewest = f"more than {common.BLOCKS} with readings are needed, not counting held-out ones"
    return f"{len(recording)} samples; {fewest}"


def _split(
    time: Array, inputs: Mapping[str, Array], heldout: Sequence[tuple[float, float]]
) -> NDArray[np.intp]:
    """Use of each sample, shape (n,).

    The inputs alone decide which blocks are held out: those most similar to the others, so that
    what they test could be learnt. The first block is not held out: only it shows the initial
    contents.
    """
    n = len(time)
    block = np.arange(n) * common.BLOCKS // n
    if heldout:
        return np.where(
            inside_of(time, heldout), HELDOUT, np.array([ESTIMATION, SELECTION])[block % 2]
        )
    turns = [np.roll(PATTERN, shift) for shift in range(len(PATTERN))]
    parts = [turn[block % len(PATTERN)] for turn in turns if turn[0] != HELDOUT]
    return min(parts, key=lambda part: _unlike(inputs, part == HELDOUT, n // common.BLOCKS))


def _unlike(inputs: Mapping[str, Array], flags: NDArray[np.bool_], length: int) -> float:
    """Largest distance of the distributions of smoothed inputs (Kolmogorov, Smirnov)."""
    far = 0.0
    for course in inputs.values():
        smooth = np.convolve(course, np.ones(length) / length)[: len(course)]
        levels = np.quantile(smooth, np.linspace(0.0, 1.0, 41))
        inside, outside = np.sort(smooth[flags]), np.sort(smooth[~flags])
        shares = [np.searchsorted(v, levels, "right") / len(v) for v in (inside, outside)]
        far = max(far, float(np.max(np.abs(shares[0] - shares[1]))))
    return round(far, 3)


def _split_in_words(time: Array, part: NDArray[np.intp], heldout: Sequence[object]) -> str:
    counts = [int((part == p).sum()) for p in (ESTIMATION, SELECTION, HELDOUT)]
    fitted, held = fixed(counts[0] + counts[1], 0), fixed(counts[2], 0)
    chosen = "as asked" if heldout else "every fifth block, by the inputs"
    return (
        f"{counted(len(time), 'sample')} in {common.BLOCKS} blocks of time: {fitted} to search and "
        f"fit, {held} held out ({chosen}); simulation runs through all of them"
    )


def noise_floor(measured: Array) -> float:
    """Scatter of a reading, shape (n,), by third differences, to which states contribute none."""
    return white_noise(np.diff(measured, 3), 3)


SHOWN = "shown:"

Values = Mapping[str, float]


@dataclass(frozen=True)
class Simulated:
    """Simulated readings per measured signal, shape (n,), SI.

    `slopes` are derivatives by the seeds, shape (n, seeds); `course` has all states and outputs.
    """

    shown: Mapping[str, Array]
    slopes: Mapping[str, Array]
    course: Course

    @property
    def stacked(self) -> Array:
        """Readings of all signals one below the other, shape (signals * samples,), SI."""
        return np.concatenate(list(self.shown.values()))


class SimulationProblem:
    """A plant, its candidates, and a recording."""

    def __init__(self, ruleset: Ruleset, builder: ModelBuilder, record: Record) -> None:
        self.ruleset, self.builder, self.record = ruleset, builder, record
        self.signals = tuple(record.measured)
        self._beliefs: dict[tuple[int, ...], Belief] = {}
        self._last: tuple[Any, Mapping[str, Array], Course] | None = None
        # Inputs that are linear between samples.
        self._linear = frozenset(s.id for s in ruleset.signals if s.between == "line")
        self.time: Array = record.time - record.time[0]
        # Noise and fits use open samples; a reading at the end of its range counts.
        self.counted: Mapping[str, Flags] = {
            n: np.isfinite(v) & record.open for n, v in record.measured.items()
        }

    @property
    def base(self) -> BaseParameters:
        """Parameters of the plain plant."""
        return self.builder.parameters

    def prior(self, setting: Configuration) -> Prior:
        """The prior of uncertain parameters that affect a measured reading, and of unknowns within
        their ranges."""
        reached = self._reached(setting.ids)
        rows = tuple(i for i, name in enumerate(self.base.ids) if name in reached)
        if rows not in self._beliefs:
            self._beliefs[rows] = belief_of(self.base, rows)
        unknowns = unknowns_of(setting.joined).values()
        bounds = {u.id: self.ends(u) for u in unknowns if not u.fixed}
        return prior_with(self._beliefs[rows], {}, bounds, setting)

    def ends(self, unknown: Unknown) -> tuple[float, float]:
        """Range of an unknown. Near the ends of a recording, an onset cannot be distinguished from
        a permanent effect, or from none."""
        if unknown.driver != TIME:
            return unknown.lowest, unknown.highest
        duration = float(self.time[-1])
        return limits.EDGE * duration, (1.0 - limits.EDGE) * duration

    def balances(self, joined: tuple[str, ...]) -> Balances:
        """The balances with candidates built in."""
        return self.builder.balances(joined)

    def _reached(self, joined: tuple[str, ...]) -> Collection[str]:
        """Plan inputs that affect a state or a measured reading."""
        plan, shown = self.balances(joined).plan, [f"{SHOWN}{n}" for n in self.signals]
        moving = ("der:", "start:", "low:", "high:", "after:")
        watched = [n for n in plan.outputs if n.startswith(moving) or n in shown]
        return plan.select(watched).used_inputs

    @cached_property
    def plain_values(self) -> dict[str, float]:
        """Values of all parameters of the plain plant, SI."""
        base = self.base
        return {**base.constants, **dict(zip(base.ids, base.values.tolist(), strict=True))}

    def simulate(
        self,
        joined: tuple[str, ...],
        values: Values,
        seeds: Sequence[str] = (),
        inputs: Mapping[str, Array] | None = None,
        locations: tuple[str, ...] = (),
    ) -> Simulated:
        """Simulate the whole recording, or with other `inputs`; raises `RanAway`.

        Errors at `locations` are inputs by their unknowns. `inputs` have shape (n,), SI.
        """
        whole = self.builder.balances(joined, locations)
        given = self.record.inputs if inputs is None else inputs
        table = np.column_stack([given[n] for n in whole.inputs] or [np.zeros((len(self.time), 0))])
        held = np.array([n not in self._linear for n in whole.inputs], dtype=np.bool_)
        course = whole.run(self.time, table, held, {**self.plain_values, **values}, seeds)
        shown, slopes = {}, {}
        for name in self.signals:
            i, (low, high) = whole.outputs.index(f"{SHOWN}{name}"), self._ends[name]
            own = course.shown[:, i]
            inside = (own > low) & (own < high)
            # A sensor shows nothing beyond its range.
            shown[name] = np.asarray(np.clip(own, low, high))
            slopes[name] = np.where(inside[:, None], course.slopes[:, i, :], 0.0)
        return Simulated(shown, slopes, course)

    @cached_property
    def _ends(self) -> dict[str, tuple[float, float]]:
        """Range of each sensor, extended to its readings."""
        found = {}
        for name, own in self.record.measured.items():
            signal = self.ruleset.signal_by_id[name]
            low = -np.inf if signal.lowest is None else min(signal.lowest, float(np.nanmin(own)))
            high = np.inf if signal.highest is None else max(signal.highest, float(np.nanmax(own)))
            found[name] = low, high
        return found

    def trajectory(
        self, joined: tuple[str, ...], values: Values, name: str, inputs: Mapping[str, Array]
    ) -> Array:
        """Course of an input, of time, or of a simulated state, flow or reading, shape (n,), SI."""
        if name == TIME:
            return self.time
        if name in inputs:
            return np.asarray(inputs[name])
        whole, model = self.balances(joined), (joined, tuple(values.items()))
        # Courses of one model are asked for in turn, as those of the drivers of all candidates.
        if self._last is None or self._last[0] != model or self._last[1] is not inputs:
            self._last = model, inputs, self.simulate(joined, values, inputs=inputs).course
        course = self._last[2]
        if name in whole.states:
            return np.ascontiguousarray(course.states[:, whole.states.index(name)])
        module, _, end = name.partition(".")
        output = f"{SHOWN}{name}" if f"{SHOWN}{name}" in whole.outputs else f"{end}:{module}"
        return np.ascontiguousarray(course.shown[:, whole.outputs.index(output)])

    @cached_property
    def floors(self) -> dict[str, float]:
        """Standard deviation of the noise of each reading, SI."""
        record = self.record
        return {
            n: max(noise_floor(v[np.isfinite(v)]), record.resolution[n])
            for n, v in record.measured.items()
        }

    @property
    def locations(self) -> list[DisturbanceLocation]:
        """Places at which a law may have an error."""
        kinds = ("balance", "definition", "reading")
        return [location for location in self.builder.locations if location.kind in kinds]

    @property
    def drivers(self) -> list[str]:
        """What an error at a place may follow: states, inputs and time."""
        assert self.ruleset.dynamics is not None
        states = [s.id for s in self.ruleset.dynamics.states]
        drivers = [*states, *self.balances(()).inputs][: limits.FOLLOWED]
        return [*drivers, TIME] if self.record.timed else drivers

    @cached_property
    def candidates(self) -> tuple[Candidate, ...]:
        """Candidates with all parameters affecting measured readings; without a common clock, only
        those that do not follow time."""
        found = []
        for candidate in self.builder.candidates:
            if self.record.timed or not candidate.follows_time:
                reached = self._reached((candidate.id,))
                if all(u.id in reached for u in candidate.unknowns if not u.fixed):
                    found.append(candidate)
        return tuple(found)

    def candidate(self, name: str) -> Candidate:
        """A candidate by id."""
        return next(c for c in self.builder.candidates if c.id == name)


def unknowns_of(joined: Sequence[Candidate]) -> dict[str, Unknown]:
    """All unknowns by id."""
    return {u.id: u for c in joined for u in c.unknowns}
