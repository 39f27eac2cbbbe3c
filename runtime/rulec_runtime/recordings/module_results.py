"""Read results of observers that run in the modules' controllers, one row per operating point.

Columns: `time` and `seconds` are beginning and length of a window, `samples` its number of samples.
``q:<observer>`` is an estimate (m3/s), ``valid:`` 1 or 0, ``s:<observer>:<error>`` its slopes,
``dq:<observer>:<fault>`` those by degrees, ``apart:<observer>`` second half of the window minus
first. ``fit:<signal>``, ``noise:<signal>``, ``systematic:<signal>``, ``beyond:<signal>`` and
``lag:<signal>`` describe readings (SI, but noise in the unit of the reading); a mean reading has a
column as in a recording.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.csv_cell import as_meant
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.formats import file_and_table, is_there, opened_sheet
from rulec_runtime.recordings.header import assign, result_of, summed
from rulec_runtime.recordings.plant_calendar import Calendar, calendar_of
from rulec_runtime.recordings.recording_file import form_of
from rulec_runtime.recordings.time_column import read_times
from rulec_runtime.recordings.titles import parts_of

KINDS = frozenset({"q", "valid", "s", "dq", "apart", "fit", "noise", "systematic", "beyond", "lag"})
"""Prefixes of columns, before the first colon."""

SECONDS, SAMPLES = "seconds", "samples"


@dataclass(frozen=True, kw_only=True)
class ModuleResults:
    """Results of modules for operating points in order of time.

    Attributes
    ----------
    since, until : shape (n,), s.
    samples : shape (n,).
    columns : per name, as ``q:A.pump``, an array, shape (n,); NaN where missing.
    readings : per signal its mean, shape (n,), SI.
    notes : remarks for the operator.
    calendar : the date of time 0, if the file has dates.
    """

    since: Array
    until: Array
    samples: np.ndarray
    columns: Mapping[str, Array]
    readings: Mapping[str, Array]
    notes: tuple[str, ...]
    calendar: Calendar | None

    def __len__(self) -> int:
        return len(self.since)

    def flags(self, name: str) -> np.ndarray:
        """Where a column of 1 and 0 is 1, shape (n,)."""
        column = self.columns.get(name)
        return np.zeros(len(self), dtype=bool) if column is None else column == 1.0


def holds_results(path: Path, ruleset: Ruleset) -> bool:
    """Whether a file holds estimates of observers instead of a recording."""
    if not is_there(path) or file_and_table(path)[0].is_dir():
        return False
    with opened_sheet(path, form_of(ruleset)) as sheet:
        titles = {parts_of(as_meant(t.strip()))[0] for t in sheet.titles}
    return any(result_of(title, ruleset) for title in titles)


def read_results(path: Path, ruleset: Ruleset) -> ModuleResults:
    """Read a CSV file (also .gz); raises `RecordingRefused` with a message for the operator."""
    notes = list[str]()
    with opened_sheet(path, form_of(ruleset)) as sheet:
        header = assign(path, sheet.titles, ruleset, notes, sheet.units, _is_result)
        table = sheet.read([header.time], [target.index for target in header.targets])
    _check(path, [target.signal for target in header.targets], ruleset)
    title, unit = header.time_title, header.time_unit
    zone, form = ruleset.time_zone, form_of(ruleset)
    time, zones = read_times(path, table.raw[0], title, unit, ruleset.units, zone, notes, form)
    pairs = zip(header.targets, table.columns, strict=True)
    values = summed(header.targets, (c.numbers() * t.factor + t.offset for t, c in pairs))
    lengths, samples = values.pop(SECONDS), values.pop(SAMPLES)
    usable = np.isfinite(time) & (lengths >= 0.0) & (samples >= 1.0)
    if not usable.any():
        raise RecordingRefused(f"{path}: no row has a time, seconds and samples")
    order = np.flatnonzero(usable)[np.argsort(time[usable], kind="stable")]
    since, calendar = time[order], None
    if zones is not None:
        start = float(since[0])
        since = since - start
        calendar = calendar_of(since, start, zones[order])
    lost = len(time) - len(order) + table.left_out
    notes += [f"{path.name}: {lost} rows without time or of odd form left out"] if lost else []
    return ModuleResults(
        since=since,
        until=since + lengths[order],
        samples=samples[order].astype(np.intp),
        columns={n: v[order] for n, v in values.items() if n.partition(":")[0] in KINDS},
        readings={n: v[order] for n, v in values.items() if n in ruleset.signal_by_id},
        notes=tuple(notes),
        calendar=calendar,
    )


def _is_result(name: str) -> bool:
    return name in (SECONDS, SAMPLES) or name.partition(":")[0] in KINDS


def _check(path: Path, names: Sequence[str], ruleset: Ruleset) -> None:
    """Refuse results without the columns that a diagnosis needs."""
    needed = [SECONDS, SAMPLES]
    needed += [f"{kind}:{o.id}" for o in ruleset.observers for kind in ("q", "valid")]
    needed += [name for name in ruleset.plan.outputs if name.startswith("s:")]
    read = sorted(ruleset.observed)
    needed += [f"{kind}:{signal}" for signal in read for kind in ("fit", "noise", "systematic")]
    missing = [name for name in needed if name not in names]
    if missing:
        more = f" is missing, and {len(missing) - 1} more are" if missing[1:] else " is missing"
        raise RecordingRefused(
            f"{path}: column '{missing[0]}'{more}; wiring.csv of rulec export tells "
            "which output of which module belongs into each"
        )
