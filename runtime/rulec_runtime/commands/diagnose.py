"""`diagnose`: judge a recording with a ruleset."""

import argparse
from pathlib import Path

from rulec_runtime import limits
from rulec_runtime.commands.destinations import (
    console,
    progress_of,
    show_files,
    write_json,
    write_to,
)
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.output.progress import Progress
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.judged import Judged, judged


def run(options: argparse.Namespace) -> int:
    """Diagnose a recording. The exit code is 0 with or without findings, `limits.NOT_ALL_JUDGED` if
    something could not be judged."""
    ruleset = read_ruleset(Path(options.plant))
    with progress_of(options, "reading and judging the recording") as progress:
        truth = Path(options.truth) if options.truth else None
        found = judged(Path(options.recording), ruleset, options.mode, truth)
        return show_results(options, found, progress)


def show_results(options: argparse.Namespace, found: Judged, progress: Progress) -> int:
    """Print the diagnosis and write the requested files; returns the exit code."""
    trace = page = ""
    if options.trace or options.report:
        progress("judging every sample")
        trace = found.trace_csv() if options.trace else ""
    if options.report:
        progress("drawing the report")
        page = found.page()
    progress.end()
    # All files first: whatever reads the story may go before its end.
    if options.trace:
        write_to(options.trace, trace)
    if options.report:
        write_to(options.report, page)
    write_json(options, found.to_dict())
    out = console(options)
    found.tell(out)
    show_files(out, {"one row per sample": options.trace, "report": options.report})
    if found.truth is not None and not options.report:
        out.print(
            styled("[dim]note: only a report (--report FILE.html) compares with the truth[/]")
        )
    return 0 if found.diagnosis.is_whole else limits.NOT_ALL_JUDGED
