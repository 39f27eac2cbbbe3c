"""`rulec experiment`: the set points that tell apart what a mismatch leaves open."""

from __future__ import annotations

import argparse

from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    progress_of,
    show_files,
    write_json,
    write_to,
)
from rulec_runtime.output.terminal import styled

from rulec.api.experiment import experiment


def run(options: argparse.Namespace) -> int:
    """Plan, report, and write the input file."""
    check_outputs(options)
    with progress_of(options, "planning the experiment"):
        found = experiment(
            options.mismatch, hours=options.hours, steps=options.steps, limits=options.limits
        )
    inputs = options.output if found.found.steps else None
    if inputs:
        write_to(inputs, found.inputs_csv())
    if options.report:
        write_to(options.report, found.page())
    write_json(options, found.to_dict())
    out = console(options)
    found.tell(out)
    if options.output and not inputs:
        out.print(styled("[dim]{} is not written: there is no step[/]", options.output))
    show_files(out, {"inputs for rulec simulate": inputs, "report": options.report})
    return 0
