"""Read the true faults, if they are known, and compare a diagnosis with them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.verdict_per_sample import Trace
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.recordings.columns import nearest
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.formats import opened_sheet
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.time_column import read_times
from rulec_runtime.recordings.titles import NAMES
from rulec_runtime.report.series import NOT_JUDGED


@dataclass(frozen=True)
class Truth:
    """True degrees at the samples of a recording, shape (faults, n); NaN where unknown."""

    name: str
    faults: tuple[str, ...]
    degree: Array
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Cases:
    """The n judged samples whose truth is known.

    Attributes
    ----------
    fault : shape (n,), the true fault as index into those of the truth; -1 if there is none.
    true, degree, lower, upper : shape (n,): true degree, and the diagnosed degree of the true
        fault, 0 if it was not named; without a true fault, that of the named fault.
    named : shape (n,), whether the verdict was right: the true fault, or none.
    """

    fault: np.ndarray
    true: Array
    degree: Array
    lower: Array
    upper: Array
    named: np.ndarray

    def __len__(self) -> int:
        return len(self.true)


def read_truth(path: Path, ruleset: Ruleset, recording: Recording) -> Truth:
    """Read ``time [s]`` and ``<fault id> [1]`` columns; other columns are ignored.

    Raises `RecordingRefused` if nothing in the file can be compared with the recording.
    """
    notes: list[str] = []
    with opened_sheet(path) as sheet:
        (index, title, unit), chosen = _columns(path, sheet.titles, ruleset, notes)
        table = sheet.read([index], list(chosen.values()))
    time, zones = read_times(path, table.raw[0], title, unit, ruleset.units)
    if zones is not None:
        raise RecordingRefused(
            f"{path}: the times are dates; write seconds since the first sample of the recording"
        )
    degree = np.array([column.numbers() for column in table.columns])
    if (degree < 0).any():
        raise RecordingRefused(f"{path}: a true degree is negative; degrees are shares from 0 on")
    sound = np.flatnonzero(np.isfinite(time))
    order = sound[np.argsort(time[sound], kind="stable")]
    time, degree = time[order], degree[:, order]
    steps = [float(np.median(np.diff(t))) for t in (time, recording.time) if len(t) > 1]
    tolerance = 0.5 * max(steps, default=1.0) * (1 + 1e-9)  # half a sampling interval
    near = nearest(time, recording.time)
    matched = np.where(np.abs(time[near] - recording.time) <= tolerance, degree[:, near], np.nan)
    unknown = int(np.isnan(matched).all(axis=0).sum())
    if unknown == len(recording):
        raise RecordingRefused(
            f"{path}: no time of it lies at a sample of the recording, which runs from "
            f"{recording.time[0]:g} s to {recording.time[-1]:g} s"
        )
    if table.left_out:
        notes.append(f"{path.name}: {table.left_out} rows are broken and left out")
    if unknown:
        notes.append(f"{path.name}: {unknown} of {len(recording)} samples have no truth")
    return Truth(path.name, tuple(chosen), matched, tuple(notes))


def _columns(
    path: Path, titles: Sequence[str], ruleset: Ruleset, notes: list[str]
) -> tuple[tuple[int, str, str], dict[str, int]]:
    """Index, title and unit of the time column, and the index of the column of each fault."""
    time, chosen = None, dict[str, int]()
    for i, title in enumerate(t.strip() for t in titles):
        name, _, unit = (part.strip(" ]") for part in title.partition("["))
        if time is None and name.lower() in NAMES:
            time = i, title, unit
        elif name in ruleset.fault_by_id:
            wanted = ruleset.fault_by_id[name].unit
            if unit not in ("", wanted or "1"):
                what = f"its degree is in {wanted}" if wanted else "degrees are shares"
                text = f"column '{title}': {what}; write '{name} [{wanted or 1}]'"
                raise RecordingRefused(f"{path}: {text}")
            if name in chosen:
                raise RecordingRefused(f"{path}: two columns hold {name}; take one out")
            chosen[name] = i
        elif unit == "1":
            hint = did_you_mean(name, ruleset.fault_by_id)
            text = f"'{title}' is no fault of this plant and is left out; {hint}"
            notes.append(f"{path.name}: {text}")
    if time is None:
        raise RecordingRefused(f"{path}: there is no time column; expected 'time [s]'")
    if not chosen:
        hint = f" ({notes[0].partition(': ')[2]})" if notes else ""
        example = ruleset.faults[0].id if ruleset.faults else "<fault>"
        raise RecordingRefused(
            f"{path}: no column is a fault of this plant{hint}; expected columns such as "
            f"'{example} [1]'"
        )
    return time, chosen


def names_at(trace: Trace) -> list[list[str]]:
    """The verdict words of each sample; some name several faults."""
    return [word.split(" + ") for word in trace.verdict]


def cases_of(truth: Truth, trace: Trace) -> Cases:
    """Compare the trace with the truth, sample by sample; the largest true fault counts.

    It counts as named only if no absent fault is named beside it.
    """
    words = np.array(trace.verdict)
    labelled = ~np.isnan(truth.degree).all(axis=0)
    index = np.flatnonzero(labelled & ~np.isin(words, NOT_JUDGED))
    degrees = np.nan_to_num(truth.degree[:, index])
    fault = np.argmax(degrees, axis=0)
    true = degrees[fault, np.arange(len(index))]
    fault = np.where(true > 0, fault, -1)
    row = {name: i for i, name in enumerate(trace.faults)}
    names = names_at(trace)
    meant = np.array([row.get(name, -1) for name in truth.faults])[fault]
    first = np.array([row.get(names[i][0], -1) for i in index], dtype=int)
    named = words[index] == "ok"
    for case in np.flatnonzero(fault >= 0):
        there = {name for name, x in zip(truth.faults, degrees[:, case], strict=True) if x > 0}
        words_here = names[index[case]]
        named[case] = truth.faults[fault[case]] in words_here and there.issuperset(words_here)
    rows = np.where(fault < 0, first, meant)
    counts = (rows >= 0) & (named | (fault < 0))
    of_trace = (trace.degree, trace.lower, trace.upper)
    degree, lower, upper = (np.where(counts, t[rows, index], 0.0) for t in of_trace)
    return Cases(fault=fault, true=true, degree=degree, lower=lower, upper=upper, named=named)
