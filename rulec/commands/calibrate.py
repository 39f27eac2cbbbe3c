"""`rulec calibrate`: fit the parameters of a plant to a fault-free recording."""

from __future__ import annotations

import argparse

from rulec_runtime.commands.destinations import (
    check_outputs,
    console,
    progress_of,
    write_json,
    write_to,
)

from rulec.api.calibrate import calibrate


def run(options: argparse.Namespace) -> int:
    """Fit, write the calibration file, show how good it is.

    Where a value is not believed, no file is written without `--force`, and the exit code is 1.
    """
    check_outputs(options)
    with progress_of(options, "fitting the modules"):
        found = calibrate(options.plant, options.recording)
    written = options.force or not found.unbelievable
    if written:
        write_to(options.output, found.text)
    found.tell(console(options), options.output, forced=options.force)
    write_json(options, found.to_dict())
    return 0 if written else 1
