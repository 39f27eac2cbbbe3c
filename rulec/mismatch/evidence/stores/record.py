"""A recording prepared for a plant that stores: evenly sampled, split into blocks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset, SignalSpec
from rulec_runtime.recordings.columns import filled, glitches_in, resolution, thinned
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.robust_statistics import Flags
from rulec_runtime.recordings.standing_still import standing_still
from rulec_runtime.report.text import counted, fixed

from rulec.mismatch import limits
from rulec.mismatch.evidence.failing_sensors import coarse_step, median_u
from rulec.mismatch.evidence.rows_used import HELD_OUT, SEARCHED, counted_rows, unread
from rulec.mismatch.evidence.samples import (
    ESTIMATION,
    HELDOUT,
    PATTERN,
    SELECTION,
    Samples,
    digest_of,
    inside_of,
)
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
    if any(n not in recording.values for n in dynamics.inputs):
        return None
    shown = [n for n in dynamics.outputs if n in recording.values]
    measured: dict[str, Array] = {}
    glitches: dict[str, int] = {}
    strange: dict[str, Flags] = {}
    for name in shown:
        values = recording.values[name]
        measured[name] = without_odd(ruleset.signal_by_id[name], values)
        strange[name] = np.isfinite(values) & ~np.isfinite(measured[name])
        glitches[name] = int(strange[name].sum())
    rows, whole = np.arange(len(recording.time)), measured
    inputs = {n: v for n, v in recording.values.items() if n in given}
    factor = -(-len(recording.time) // limits.SAMPLE_BUDGET)
    time, inputs, measured = thinned(recording.time, inputs, measured, factor)
    inputs = {n: filled(v) for n, v in inputs.items() if np.isfinite(v).any()}
    if any(n not in inputs for n in dynamics.inputs) or len(time) < limits.BLOCKS:
        return None
    part = _split(time, inputs, heldout)
    open_ = part != HELDOUT
    measured = {n: v for n, v in measured.items() if np.isfinite(v[open_]).sum() > limits.BLOCKS}
    if not measured:
        return None
    return Record(
        time=time,
        inputs=inputs,
        measured=measured,
        resolution={n: _resolution(recording.values[n], ruleset.signal_by_id[n]) for n in measured},
        glitches=glitches,
        part=part,
        split=_split_in_words(time, part, heldout),
        digest=digest_of(time, part),
        sample=np.where(rows < len(time) * factor, rows // factor, -1),
        read=np.any([np.isfinite(whole[n]) for n in measured], axis=0),
        odd=np.any([strange[n] for n in measured], axis=0),
        timed=recording.one_clock,
    )


def coarser(record: Record, most: int) -> Record:
    """Average neighbours, to at most `most` samples."""
    factor = -(-len(record.time) // most)
    time, inputs, measured = thinned(record.time, record.inputs, record.measured, factor)
    part = record.part[::factor][: len(time)]
    return replace(record, time=time, inputs=inputs, measured=measured, part=part)


def without_odd(signal: SignalSpec, values: Array) -> Array:
    """Readings without outliers and stuck ones, shape (n,)."""
    odd = glitches_in(values)
    for first, behind in standing_still(values, ends=(signal.lowest, signal.highest)):
        odd[first + 1 : behind] = True
    return np.where(odd, np.nan, values)


def _resolution(values: Array, signal: SignalSpec) -> float:
    """Standard deviation by the steps of a reading."""
    step = coarse_step(values, median_u(signal, values))
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
        known = recording.values
        return [n for n in names if n not in known or not np.isfinite(known[n]).any()]

    if given := absent(dynamics.inputs):
        return f"{', '.join(given)} drives the plant and is not in the recording"
    if len(absent(dynamics.outputs)) == len(dynamics.outputs):
        return f"it needs a reading of {' or '.join(dynamics.outputs)}; the recording has none"
    return f"{len(recording)} samples; more than {limits.BLOCKS} with readings are needed"


def _split(
    time: Array, inputs: Mapping[str, Array], heldout: Sequence[tuple[float, float]]
) -> NDArray[np.intp]:
    """Use of each sample, shape (n,).

    The inputs alone decide which blocks are held out: those most similar to the others, so that
    what they test could be learnt. The first block is not held out: only it shows the initial
    contents.
    """
    n = len(time)
    block = np.arange(n) * limits.BLOCKS // n
    if heldout:
        return np.where(
            inside_of(time, heldout), HELDOUT, np.array([ESTIMATION, SELECTION])[block % 2]
        )
    turns = [np.roll(PATTERN, shift) for shift in range(len(PATTERN))]
    parts = [turn[block % len(PATTERN)] for turn in turns if turn[0] != HELDOUT]
    return min(parts, key=lambda part: _unlike(inputs, part == HELDOUT, n // limits.BLOCKS))


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
        f"{counted(len(time), 'sample')} in {limits.BLOCKS} blocks of time: {fitted} to search and "
        f"fit, {held} held out ({chosen}); simulation runs through all of them"
    )
