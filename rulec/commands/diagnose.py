"""`rulec diagnose`: judge a recording with a ruleset, or with a plant compiled on the way."""

from __future__ import annotations

import argparse

from rulec_runtime.commands.destinations import check_outputs, progress_of
from rulec_runtime.commands.diagnose import show_results

from rulec.api.diagnose import diagnose


def run(options: argparse.Namespace) -> int:
    """Diagnose a recording; the exit code is that of `rulec-runtime diagnose`."""
    check_outputs(options)
    with progress_of(options, "reading and judging the recording") as progress:
        found = diagnose(
            options.plant,
            options.recording,
            mode=options.mode,
            limits=options.limits,
            truth=options.truth,
        )
        return show_results(options, found.judged, progress)
