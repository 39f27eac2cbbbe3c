"""`rulec diagnose`: judge a recording with a ruleset, or with a plant compiled on the way."""

from __future__ import annotations

import argparse
import contextlib
from pathlib import Path

from rich.markup import escape

from rulec.commands.output import console, write_json, write_text
from runtime.diagnose import diagnose, trace
from runtime.explain import explain
from runtime.machine_form import diagnosis_form, trace_csv
from runtime.recording import read_recording
from runtime.report.page import report
from runtime.report.truth import read_truth
from runtime.ruleset import Ruleset
from runtime.ruleset_file import read_ruleset


def run(options: argparse.Namespace) -> int:
    """Diagnose a recording; findings are a result, so the exit code is 0 either way."""
    out = console(options)
    ruleset = load(Path(options.plant))
    with (
        out.status("reading and judging the recording")
        if out.is_terminal
        else contextlib.nullcontext()
    ):
        recording = read_recording(Path(options.recording), ruleset)
        truth = read_truth(Path(options.truth), ruleset, recording) if options.truth else None
        diagnosis = diagnose(recording, ruleset, options.mode)
    explain(out, diagnosis)
    if options.truth and not options.report:
        out.print("[dim]note: only a report (--report FILE.html) compares with the truth[/]")
    if options.trace or options.report:
        with out.status("judging every sample") if out.is_terminal else contextlib.nullcontext():
            result = trace(recording, ruleset, options.mode)
    if options.trace:
        write_text(Path(options.trace), trace_csv(result, ruleset))
        out.print(f"[dim]one row per sample: {options.trace}[/]")
    if options.report:
        page = report(recording, diagnosis, result, Path(options.recording).name, truth)
        write_text(Path(options.report), page)
        out.print(f"[dim]report: {escape(options.report)}[/]")
    write_json(options, diagnosis_form(diagnosis))
    return 0


def load(path: Path) -> Ruleset:
    """Read a ruleset file, or compile a plant (which alone needs the compiler)."""
    if path.suffix == ".json":
        return read_ruleset(path)
    from rulec.pipeline import compile_plant

    return compile_plant(path)
