"""`rulec study`: what the diagnoser of a plant can do, before anybody trusts it."""

from __future__ import annotations

import argparse
import os
from contextlib import ExitStack

from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    note_aside,
    progress_of,
    show_files,
    write_json,
    write_to,
)
from rulec_runtime.output.refusal import Misused

from rulec.api.study import JUDGING, study


def run(options: argparse.Namespace) -> int:
    """Simulate, judge, count, and report what it means."""
    degrees = degrees_of(options.degrees)
    check_outputs(options)
    with ExitStack() as until_done:
        progress = progress_of(options, JUDGING)

        def announce(text: str) -> None:
            note_aside(options, text)
            until_done.enter_context(progress)

        found = study(
            options.plant,
            degrees=degrees,
            points=options.points,
            seeds=options.seeds,
            lead_in=options.lead_in,
            mode=options.mode,
            bounded=options.bounded,
            jobs=options.jobs if options.jobs is not None else os.cpu_count() or 1,
            engine=options.engine,
            scheduler=options.scheduler,
            announce=announce,
            progress=progress,
        )
    if options.report:
        write_to(options.report, found.page())
    write_json(options, found.to_dict())
    out = console(options)
    found.tell(out)
    show_files(out, {"report": options.report})
    return 0


def degrees_of(text: str) -> list[float]:
    """The degrees of an option; raises `Misused` if they are not numbers."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise Misused(
            f"--degrees {text}: give numbers with commas between, such as 0.1,0.2,0.3"
        ) from None
