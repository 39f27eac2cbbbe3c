"""`rulec calibrate`: fit the parameters of a plant to a fault-free recording."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    progress_of,
    write_json,
    write_to,
)
from rulec_runtime.output.refusal import Misused

from rulec.api.calibrate import calibrate


def run(options: argparse.Namespace) -> int:
    """Fit, write the calibration file, and show how good it is.

    If a value is not believable, no file is written without `--force`, and the exit code is 1.
    """
    check_outputs(options)
    if options.learn is not None:
        return _learn(options)
    if options.over is not None:
        raise Misused("--over says what --learn learns over; give both")
    with progress_of(options, "fitting the modules"):
        found = calibrate(options.plant, options.recording)
    written = options.force or not found.unbelievable
    if written:
        write_to(options.output, found.text)
    write_json(options, found.to_dict())
    found.tell(console(options), options.output, forced=options.force)
    return 0 if written else 1


def _learn(options: argparse.Namespace) -> int:
    """Learn a curve, and write the module type that holds it."""
    from rulec.api.learn import learn

    with progress_of(options, "learning the curve"):
        found = learn(options.plant, options.recording, options.learn, over=options.over)
    write_to(options.output, found.text(Path(options.output).stem))
    found.tell(console(options), options.output)
    write_json(options, found.to_dict())
    return 0
