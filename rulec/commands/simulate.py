"""`rulec simulate`: the recording that a plant should have made, with faults if asked for."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from rulec_runtime.commands.destinations import console
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import say_aside, styled
from rulec_runtime.output.write_file import STANDARD_OUTPUT, written
from rulec_runtime.recordings.formats import BINARY
from rulec_runtime.recordings.given import is_there, place_of
from rulec_runtime.recordings.recording_file import RecordingFile, files_of, read_file

from rulec.commands.diagnose import load
from rulec.simulation.equations import SimulationRefused
from rulec.simulation.first_readings import Starts, starts_of
from rulec.simulation.predict import Prediction, predict
from rulec.simulation.prediction import Injected
from rulec.simulation.rewrite import rewrite

SHOWN = 6

OTHERS = frozenset(suffix for kind in BINARY for suffix in kind.suffixes)
"""Endings of recordings that are read, and not written."""


def run(options: argparse.Namespace) -> int:
    """Predict, write, say what is in it and what is not."""
    source, target = Path(options.inputs), Path(options.output)
    try:
        injected = [parse_fault(text) for text in options.fault]
        _refuse_target(source, target)
        if options.noise is not None and options.noise < 0:
            raise ValueError(f"--noise {options.noise}: give a number from 0 on")
    except ValueError as mistake:
        say_aside(f"rulec simulate: {mistake}")
        return 2
    ruleset = load(Path(options.plant))
    notes: list[str] = []
    files = [read_file(path, ruleset, notes) for path in files_of(source)]
    starts = _starts(ruleset, source, options.start, notes)
    prediction = predict(ruleset, files, injected, options.noise, [s.values for s in starts])
    notes += (note for start in starts for note in start.notes)
    _write(ruleset, files, prediction, target, place_of(source)[0].is_dir())
    for note in dict.fromkeys([*notes, *prediction.notes]):
        say_aside(f"note: {note}")
    out = console(options)
    out.print(styled("[green]✓[/] {}", _summary(prediction, target)), soft_wrap=True)
    return 0


def _starts(
    ruleset: Ruleset, source: Path, recording: str | None, notes: list[str]
) -> list[Starts]:
    """Where states start in each file of the inputs; nothing where no recording tells."""
    if recording is None:
        return []
    told, wanted = Path(recording), files_of(source)
    paths = [told / path.name for path in wanted] if source.is_dir() else [told]
    absent = [path for path in paths if not is_there(path)]
    if absent:
        what = "the inputs are a folder, so give a folder with a file of each name"
        raise SimulationRefused(
            f"--start {told}: no file {absent[0]}" + (f"; {what}" if source.is_dir() else "")
        )
    return [starts_of(ruleset, read_file(path, ruleset, notes)) for path in paths]


def parse_fault(text: str) -> Injected:
    """Read ``M.fault=degree`` or ``M.fault=degree@from:to``; ValueError with a message."""
    name, _, rest = text.partition("=")
    size, _, period = rest.partition("@")
    since, _, until = period.partition(":") if period else ("-inf", "", "inf")
    try:
        found = Injected(name.strip(), float(size), float(since or "-inf"), float(until or "inf"))
    except ValueError:
        found = Injected("", math.nan)
    if not found.fault or not math.isfinite(found.degree) or not found.since <= found.until:
        raise ValueError(
            f"--fault {text}: write <module>.<fault>=<degree>, where 0.2 is 20 %; for a period "
            "<module>.<fault>=<degree>@<from>:<to> in seconds"
        )
    return found


def _refuse_target(source: Path, target: Path) -> None:
    """What was measured is not overwritten; a folder goes to a folder, a file to a file."""
    if place_of(target)[0].suffix.lower() in OTHERS:
        raise ValueError(f"-o {target}: recordings are written as CSV; name it .csv or .csv.gz")
    source = place_of(source)[0]
    if source.is_dir() and target == STANDARD_OUTPUT:
        raise ValueError("-o -: the inputs are a folder; give the name of a folder")
    if source.exists() and target.exists() and source.resolve() == target.resolve():
        raise ValueError(f"-o {target}: this would overwrite the inputs; give another name")
    if source.is_dir() and target.is_file():
        raise ValueError(f"-o {target}: the inputs are a folder; give the name of a folder")
    if source.is_file() and target.is_dir():
        raise ValueError(f"-o {target}: this is a folder; give the name of a file")


def _write(
    ruleset: Ruleset,
    files: list[RecordingFile],
    prediction: Prediction,
    target: Path,
    is_folder: bool,
) -> None:
    """One file of the same name for each file of a folder."""
    if is_folder:
        target.mkdir(parents=True, exist_ok=True)
    first = 0
    for file in files:
        last = first + len(file.time)
        values = {name: v[first:last] for name, v in prediction.values.items()}
        with written(target / csv_name(file.path) if is_folder else target) as out:
            rewrite(file, ruleset, values, out)
        first = last


def csv_name(path: Path) -> str:
    """Name of the CSV file that is made of a recording of any format.

    >>> csv_name(Path("run.parquet")), csv_name(Path("run.csv.gz")), csv_name(Path("a.h5#slow"))
    ('run.csv', 'run.csv.gz', 'a.csv')
    """
    file = path.with_name(path.name.partition("#")[0])
    return f"{file.stem}.csv" if file.suffix.lower() in OTHERS else path.name


def _summary(prediction: Prediction, target: Path) -> str:
    rows, whole = len(prediction.whole), int(np.count_nonzero(prediction.whole))
    count = f"{rows} rows" if rows == whole else f"{rows} rows, {whole} of them predicted in full"
    found, given = _few(prediction.values), _few(prediction.given)
    where = "standard output" if target == STANDARD_OUTPUT else target
    return f"{where}: {count}; predicted {found} from {given or 'nothing'}"


def _few(names: Iterable[str]) -> str:
    found = list(names)
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return ", ".join(found[:SHOWN]) + more
