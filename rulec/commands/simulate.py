"""`rulec simulate`: the recording that a plant should have made, with faults on request."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec_runtime.commands.destinations import (
    STANDARD_OUTPUT,
    console,
    note_aside,
    progress_of,
    write_to,
)
from rulec_runtime.output.refusal import Misused
from rulec_runtime.recordings.formats import OTHERS, place_of

from rulec.api.simulate import parse_fault, simulate


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
    console(options).print(found.headline(options.output), soft_wrap=True)
    return 0


def _check_target(inputs: str, output: str) -> None:
    """Refuse to overwrite the inputs; a folder goes to a folder, a file to a file."""
    source, target = place_of(Path(inputs))[0], Path(output)
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
