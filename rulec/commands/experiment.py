"""`rulec experiment`: the set points that tell apart what a mismatch leaves open."""

from __future__ import annotations

import argparse

from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    progress_of,
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
    out = console(options)
    found.tell(out)
    if options.output and found.found.steps:
        write_to(options.output, found.inputs_csv())
        out.print(styled("[dim]inputs for rulec simulate: {}[/]", options.output))
    elif options.output:
        out.print(styled("[dim]{} is not written: there is no step[/]", options.output))
    if options.report:
        write_to(options.report, found.page())
        out.print(styled("[dim]report: {}[/]", options.report))
    write_json(options, found.to_dict())
    return 0
