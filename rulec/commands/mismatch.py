"""`rulec mismatch`: tell where simulation and recording differ, and what physics is left out."""

from __future__ import annotations

import argparse
import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text
from rulec_runtime.commands.destinations import console, without_folder, write_json
from rulec_runtime.output.terminal import one_line, say_aside, styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.together import names_of, read_recordings
from rulec_runtime.report.text import listed

from rulec.commands.made_from import basis_of
from rulec.effects.model_builder import open_builder
from rulec.mismatch.analyse import analyse
from rulec.mismatch.answer.json_form import hidden_csv, mismatch_form
from rulec.mismatch.answer.page import report
from rulec.mismatch.answer.terminal_story import tell
from rulec.mismatch.inference.series import series_csv
from rulec.mismatch.result import Mismatch, MismatchRefused

STORES_ALONE = (
    "this plant stores: what a recording began with belongs to it alone, and several cannot be "
    "judged together. Judge each recording alone, or record the experiment as one"
)
"""Why several recordings of a plant that stores are refused."""

Periods = tuple[tuple[float, float], ...]


def run(options: argparse.Namespace) -> int:
    """Compare; a mismatch is a result, so the exit code is 0 whatever the verdict."""
    try:
        heldout = periods_of(options.heldout)
        _check(options)
    except ValueError as mistake:
        say_aside(f"rulec mismatch: {mistake}")
        return 2
    out = console(options)
    found, basis = _compare(out, options, heldout)
    tell(out, found)
    if options.report:
        write_text(Path(options.report), report(found))
        out.print(styled("[dim]report: {}[/]", options.report))
    if options.series:
        write_text(Path(options.series), series_csv(found.series))
        out.print(styled("[dim]courses of the models: {}[/]", options.series))
    hidden = _write_hidden(out, options, found)
    form = mismatch_form(found, Path(options.plant).resolve().as_posix(), hidden)
    form["repair"]["made_from"] = basis
    write_json(options, form)
    return 0


def periods_of(texts: Sequence[str]) -> Periods:
    """Held-out periods in s; ValueError with a message for a bad one.

    >>> periods_of(["0:60", "120:180.5"])
    ((0.0, 60.0), (120.0, 180.5))
    """
    periods = []
    for text in texts:
        parts = text.split(":")
        try:
            since, until = (float(part) for part in parts)
        except ValueError:
            since = until = math.nan
        if not (math.isfinite(since) and math.isfinite(until)):
            raise ValueError(
                f"--heldout {text}: give two numbers of seconds with a colon between, as in 600:900"
            )
        if not since < until:
            raise ValueError(
                f"--heldout {text}: it ends before it begins; did you mean {parts[1]}:{parts[0]}?"
                if until < since
                else f"--heldout {text}: it has no length"
            )
        periods.append((since, until))
    return tuple(periods)


def _check(options: argparse.Namespace) -> None:
    """What can be refused before long work."""
    if options.plant.endswith(".json"):
        raise ValueError(
            f"{options.plant}: give the plant's folder; a ruleset does not hold the equations "
            "into which physics could be built"
        )
    unwritable = without_folder(options, "json", "report", "series")
    if unwritable is not None:
        raise ValueError(unwritable)


def _compare(
    out: Console, options: argparse.Namespace, heldout: Periods
) -> tuple[Mismatch, dict[str, Any]]:
    """Compile, read and analyse, with progress shown; the result, and hashes of its sources."""
    with _progress(out) as progress:
        progress("reading the plant")
        ruleset, builder = open_builder(Path(options.plant))
        paths = [Path(path) for path in options.recording]
        if len(paths) > 1 and ruleset.dynamics is not None:
            raise MismatchRefused(STORES_ALONE)
        basis = basis_of(builder, paths)
        progress("reading the recording" if len(paths) == 1 else "reading the recordings")
        recording = read_recordings(paths, ruleset)
        check_heldout(recording, heldout)
        found = analyse(recording, ruleset, builder, heldout=heldout, progress=progress)
    name = listed(names_of(paths))
    notes = tuple(dict.fromkeys((*found.notes, *recording.notes)))
    return replace(found, recording=name, notes=notes), basis


def check_heldout(recording: Recording, heldout: Periods) -> None:
    """Refuse periods that hold no sample, or all of them."""
    time, inside = recording.time, recording.time != recording.time
    for since, until in heldout:
        here = (time >= since) & (time <= until)
        if not here.any():
            raise MismatchRefused(
                f"--heldout {since:g}:{until:g}: the recording has no sample there; it runs from "
                f"{time[0]:g} s to {time[-1]:g} s"
            )
        inside |= here
    if inside.all():
        raise MismatchRefused(
            "--heldout takes the whole recording; leave a part from which to find something"
        )


@contextlib.contextmanager
def _progress(out: Console) -> Iterator[Callable[[str], None]]:
    """Shows progress on a terminal, and nothing elsewhere."""
    if not out.is_terminal:
        yield lambda text: None
        return
    with out.status("") as status:
        yield lambda text: status.update(Text(one_line(text)))


def _write_hidden(out: Console, options: argparse.Namespace, found: Mismatch) -> str | None:
    """Write the course of a hidden driver beside the JSON; the name of its file."""
    if found.hidden is None or options.json in (None, "-"):
        return None
    target = Path(options.json)
    series = target.with_name(f"{target.stem}.hidden.csv")
    write_text(series, hidden_csv(found.hidden))
    out.print(styled("[dim]course of what is not recorded: {}[/]", series))
    return series.name
