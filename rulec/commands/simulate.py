"""`rulec simulate`: the recording that a plant should have made, with faults on request."""

from __future__ import annotations

import argparse
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite, isnan
from pathlib import Path
from typing import Any, ClassVar, TextIO

import numpy as np
from rich.console import Console
from rulec_runtime.commands.destinations import (
    STANDARD_OUTPUT,
    console,
    note_aside,
    progress_of,
    write_to,
)
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import written
from rulec_runtime.recordings.formats import OTHERS, csv_name, file_and_table, is_there
from rulec_runtime.recordings.recording_file import RecordingFile, files_of, read_file

from rulec.commands.arguments import Plant, Recorded, files_given, is_path, names_given, ruleset_of
from rulec.commands.result import AnyPath, Result
from rulec.simulation.equations import SimulationRefused
from rulec.simulation.first_readings import Starts, starts_of
from rulec.simulation.predict import predict
from rulec.simulation.predict_settled import times_of
from rulec.simulation.prediction import Injected, Prediction, column_of, rewrite, write_columns

SHOWN = 6


@dataclass(frozen=True, kw_only=True)
class SimulateResult(Result):
    """A recording as the model of a plant predicts it.

    Attributes
    ----------
    files : the files of the inputs.
    prediction : an array per predicted signal, shape (n,), SI; NaN where it is not predicted.
    notes : remarks for the user.
    folder, in_memory : whether the inputs were a folder, or no file at all.

    Table: `recording`, with ``time [s]`` and a column per signal in its unit, which the other
    functions accept as a recording.
    """

    ruleset: Ruleset
    files: tuple[RecordingFile, ...]
    prediction: Prediction
    notes: tuple[str, ...]
    folder: bool = False
    in_memory: bool = False

    def __repr__(self) -> str:
        return f"<SimulateResult {self.ruleset.plant}: {self.summary}>"

    @property
    def summary(self) -> str:
        """How many rows were predicted, which signals, and from which, in words."""
        whole = self.prediction.whole
        rows, full = len(whole), int(np.count_nonzero(whole))
        count = f"{rows} rows" if rows == full else f"{rows} rows, {full} of them predicted in full"
        found, given = _few(self.prediction.values), _few(self.prediction.given)
        return f"{count}; predicted {found} from {given or 'nothing'}"

    def columns(self) -> dict[str, Array]:
        """Readings by title, such as ``A.dp [bar]``, shape (n,), in the unit of the title.

        Predicted readings replace recorded ones; all others are as recorded.
        """
        values: dict[str, Array] = {}
        for name in dict.fromkeys(n for file in self.files for n in file.values):
            parts = [f.values.get(name, np.full(len(f.time), np.nan)) for f in self.files]
            values[name] = np.concatenate(parts)
        values |= self.prediction.values
        found = {"time [s]": times_of(self.files)}
        for name, readings in values.items():
            title, factor, offset = column_of(name, self.ruleset)
            found[title] = (readings - offset) / factor
        return found

    def to_dict(self) -> dict[str, Any]:
        """Columns by title, None where nothing is predicted, with signals and notes."""
        return {
            "plant": self.ruleset.plant,
            "given": list(self.prediction.given),
            "predicted": list(self.prediction.values),
            "notes": list(self.notes),
            "columns": {
                title: [None if isnan(v) else v for v in readings.tolist()]
                for title, readings in self.columns().items()
            },
        }

    def to_csv(self) -> str:
        """The recording as a file would hold it; for a folder that of its first file."""
        out = io.StringIO()
        self._put(*next(iter(self._parts())), out)
        return out.getvalue()

    def write(self, target: AnyPath) -> None:
        """Write the recording in the layout of the inputs; for a folder, into a folder."""
        place = Path(target)
        if self.folder:
            place.mkdir(parents=True, exist_ok=True)
        for file, values in self._parts():
            with written(place / csv_name(file.path) if self.folder else place) as out:
                self._put(file, values, out)

    def _put(self, file: RecordingFile, values: Mapping[str, Array], out: TextIO) -> None:
        if self.in_memory:
            write_columns(self.columns(), out)
        else:
            rewrite(file, self.ruleset, values, out)

    def _parts(self) -> Iterator[tuple[RecordingFile, dict[str, Array]]]:
        """Each file with the predictions for its rows."""
        first = 0
        for file in self.files:
            last = first + len(file.time)
            yield file, {name: v[first:last] for name, v in self.prediction.values.items()}
            first = last

    def tell(self, out: Console) -> None:
        """Print what was predicted, and remarks."""
        for note in self.notes:
            out.print(styled("[dim]note: {}[/]", note))
        self.tell_headline(out, self.ruleset.plant)

    def tell_headline(self, out: Console, name: str) -> None:
        """Print what was predicted, in a line, under a `name` such as that of its file."""
        out.print(styled("[green]✓[/] {}: {}", name, self.summary), soft_wrap=True)

    _tables: ClassVar = {"recording": columns}


def simulate(
    plant: Plant,
    inputs: Recorded,
    *,
    faults: Sequence[str | Injected] = (),
    noise: int | None = None,
    start: Recorded | None = None,
) -> SimulateResult:
    """Predict a recording from its inputs, with faults on request.

    Parameters
    ----------
    plant : folder, plant.yaml, ruleset file, or what `rulec.compile` returned.
    inputs : path, data frame or mapping of arrays of shape (n,), with the readings that no
        equation determines, such as speeds.
    faults : each as ``A.leakage=0.2`` (a degree: 20 %), followed by ``@60:120`` to limit it to a
        period, s.
    noise : seed of the sensor errors; None for readings without errors.
    start : recording whose first readings determine what is stored at the beginning.

    Raises
    ------
    Refused, RulesetRefused
        The plant or its ruleset has mistakes.
    RecordingRefused
        The inputs are no recording of this plant.
    SimulationRefused
        The plant cannot be simulated, an input is missing, or the plant has no such fault.
    Misused
        A fault or a number makes no sense.

    Examples
    --------
    >>> import numpy as np, rulec
    >>> rpm = np.full(20, 1450.0)
    >>> inputs = {"time [s]": np.arange(20.0), **{f"{m}.n [1/min]": rpm for m in "AB"}}
    >>> sorted(rulec.simulate("plants/abc", inputs).prediction.values)
    ['A.P_el', 'A.dp', 'B.P_el', 'B.dp', 'C.dp']
    """
    injected = [parse_fault(one) if isinstance(one, str) else one for one in faults]
    if noise is not None and noise < 0:
        raise Misused(f"--noise {noise}: give a number from 0 on")
    ruleset = ruleset_of(plant)
    notes: list[str] = []
    (name,) = names_given([inputs])
    files = files_given(inputs, name, ruleset, notes)
    starts = _starts(ruleset, name, start, notes)
    prediction = predict(ruleset, files, injected, noise, [s.values for s in starts])
    notes += (note for one in starts for note in one.notes)
    return SimulateResult(
        ruleset=ruleset,
        files=tuple(files),
        prediction=prediction,
        notes=tuple(dict.fromkeys([*notes, *prediction.notes])),
        folder=file_and_table(name)[0].is_dir() and is_path(inputs),
        in_memory=not is_path(inputs),
    )


def parse_fault(text: str) -> Injected:
    """Read ``M.fault=degree`` or ``M.fault=degree@from:to``; raises `Misused` for anything else.

    >>> parse_fault("A.leakage=0.2@60:120")
    Injected(fault='A.leakage', degree=0.2, since=60.0, until=120.0)
    """
    name, _, rest = text.partition("=")
    size, _, period = rest.partition("@")
    since, _, until = period.partition(":") if period else ("-inf", "", "inf")
    try:
        found = Injected(name.strip(), float(size), float(since or "-inf"), float(until or "inf"))
    except ValueError:
        found = Injected("", float("nan"))
    if found.since > found.until:
        raise Misused(f"--fault {text}: the period ends before it begins")
    if not found.fault or not isfinite(found.degree) or not found.since <= found.until:
        raise Misused(
            f"--fault {text}: write <module>.<fault>=<degree>, where 0.2 is 20 %; for a period "
            "<module>.<fault>=<degree>@<from>:<to> in seconds"
        )
    return found


def _starts(
    ruleset: Ruleset, source: Path, recording: Recorded | None, notes: list[str]
) -> list[Starts]:
    """Initial states for each file of the inputs; empty without a recording."""
    if recording is None:
        return []
    (name,) = names_given([recording])
    if not is_path(recording):
        return [starts_of(ruleset, f) for f in files_given(recording, name, ruleset, notes)]
    is_folder = file_and_table(source)[0].is_dir()
    wanted = [name / path.name for path in files_of(source)] if is_folder else [name]
    absent = [path for path in wanted if not is_there(path)]
    if absent:
        what = "the inputs are a folder, so give a folder with a file of each name"
        raise SimulationRefused(
            f"--start {name}: no file {absent[0]}" + (f"; {what}" if is_folder else "")
        )
    return [starts_of(ruleset, read_file(path, ruleset, notes)) for path in wanted]


def _few(names: Iterable[str]) -> str:
    found = list(names)
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return ", ".join(found[:SHOWN]) + more


def run(options: argparse.Namespace) -> int:
    """Predict, write, and report what was predicted."""
    faults = [parse_fault(text) for text in options.fault]
    _check_target(options.inputs, options.output)
    with progress_of(options, "simulating"):
        found = simulate(
            options.plant, options.inputs, faults=faults, noise=options.noise, start=options.start
        )
    if options.output == STANDARD_OUTPUT:
        write_to(options.output, found.to_csv())
    else:
        found.write(options.output)
    for note in found.notes:
        note_aside(options, f"note: {note}")
    found.tell_headline(console(options), options.output)
    return 0


def _check_target(inputs: str, output: str) -> None:
    """Refuse to overwrite the inputs; a folder goes to a folder, a file to a file."""
    source, target = file_and_table(Path(inputs))[0], Path(output)
    if target.suffix.lower() in OTHERS:
        raise Misused(f"-o {target}: recordings are written as CSV; name it .csv or .csv.gz")
    if output == STANDARD_OUTPUT:
        if source.is_dir():
            raise Misused("-o -: the inputs are a folder; give the name of a folder")
        return
    if source.exists() and target.exists() and source.resolve() == target.resolve():
        raise Misused(f"-o {target}: this would overwrite the inputs; give another name")
    if source.is_dir() and target.is_file():
        raise Misused(f"-o {target}: the inputs are a folder; give the name of a folder")
    if source.is_file() and target.is_dir():
        raise Misused(f"-o {target}: this is a folder; give the name of a file")
