"""`diagnose`: judge a recording with a ruleset."""

from __future__ import annotations

import argparse
import contextlib
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from rich.console import Console

from rulec_runtime.commands.destinations import console, write_json
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import read_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.from_modules import FIRST_ORDER, diagnose_results
from rulec_runtime.diagnosis.trace import trace
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.module_results import holds_results, read_results
from rulec_runtime.recordings.recording import read_recording
from rulec_runtime.report.json_form import diagnosis_form, trace_csv
from rulec_runtime.report.page import report
from rulec_runtime.report.terminal_story import explain
from rulec_runtime.report.truth import read_truth


def run(
    options: argparse.Namespace,
    load: Callable[[Path], Ruleset] = read_ruleset,
    complete: Callable[[Diagnosis], Diagnosis] | None = None,
) -> int:
    """Diagnose a recording; findings are a result, so the exit code is 0 either way.

    `load` makes a ruleset of what was named: where there is a compiler, of a plant as well.
    `complete` adds what only a simulation can say.
    """
    out = console(options)
    ruleset = load(Path(options.plant))
    if holds_results(Path(options.recording), ruleset):
        return _by_results(options, out, ruleset, complete)
    with _waiting(out, "reading and judging the recording"):
        recording = read_recording(Path(options.recording), ruleset)
        truth = read_truth(Path(options.truth), ruleset, recording) if options.truth else None
        diagnosis = diagnose(recording, ruleset, options.mode)
        if complete is not None:
            diagnosis = complete(diagnosis)
    explain(out, diagnosis)
    if options.trace or options.report:
        with _waiting(out, "judging every sample"):
            result = trace(recording, ruleset, options.mode)
    if options.trace:
        write_text(Path(options.trace), trace_csv(result, ruleset))
        out.print(styled("[dim]one row per sample: {}[/]", options.trace))
    if options.report:
        with _waiting(out, "drawing the report"):
            name = Path(options.recording).resolve().name
            page = report(recording, diagnosis, result, name, truth)
        write_text(Path(options.report), page)
        out.print(styled("[dim]report: {}[/]", options.report))
    elif truth is not None:
        note = "[dim]note: only a report (--report FILE.html) compares with the truth[/]"
        out.print(styled(note))
    write_json(options, diagnosis_form(diagnosis))
    return 0


def _by_results(
    options: argparse.Namespace,
    out: Console,
    ruleset: Ruleset,
    complete: Callable[[Diagnosis], Diagnosis] | None,
) -> int:
    """The same of what modules say of themselves."""
    for name in ("trace", "report", "truth"):
        if getattr(options, name) is not None:
            raise RecordingRefused(
                f"--{name} needs a recording; results of modules have no samples"
            )
    if options.mode != "default":
        raise RecordingRefused(
            f"--mode {options.mode} needs a recording: its rules read the sensors themselves"
        )
    with _waiting(out, "judging the results of the modules"):
        diagnosis = diagnose_results(read_results(Path(options.recording), ruleset), ruleset)
        if complete is not None and FIRST_ORDER not in diagnosis.notes:
            diagnosis = complete(diagnosis)
    explain(out, diagnosis)
    write_json(options, diagnosis_form(diagnosis))
    return 0


def _waiting(out: Console, what: str) -> AbstractContextManager[object]:
    """A spinner while something takes its time, where somebody watches."""
    return out.status(what) if out.is_terminal else contextlib.nullcontext()
