"""`rulec adopt`: write the plant that a mismatch asks for."""

from __future__ import annotations

import argparse

from rulec_runtime.commands.destinations import STANDARD_OUTPUT, console, progress_of
from rulec_runtime.output.refusal import Misused

from rulec.api.adopt import adopt


def run(options: argparse.Namespace) -> int:
    """Write the plant and print a summary."""
    if options.output == STANDARD_OUTPUT:
        raise Misused("-o -: a plant is a folder; give its name")
    with progress_of(options, "writing the plant and trying it out"):
        found = adopt(options.mismatch, options.output, recalibrated=options.recalibrated)
    found.tell(console(options))
    return 0
