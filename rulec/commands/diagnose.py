"""`rulec diagnose`: judge a recording with a ruleset, or with a plant compiled on the way."""

from __future__ import annotations

import argparse
import contextlib
from contextlib import AbstractContextManager
from pathlib import Path

from rich.console import Console

from rulec.commands.output import console, write_json
from runtime.diagnose import diagnose
from runtime.explain import explain
from runtime.machine_form import diagnosis_form, trace_csv
from runtime.recording import read_recording
from runtime.report.page import report
from runtime.report.truth import read_truth
from runtime.ruleset import Ruleset
from runtime.ruleset_file import read_ruleset
from runtime.terminal import styled
from runtime.trace import trace
from runtime.write_file import write_text


def run(options: argparse.Namespace) -> int:
    """Diagnose a recording; findings are a result, so the exit code is 0 either way."""
    out = console(options)
    ruleset = load(Path(options.plant))
    with _waiting(out, "reading and judging the recording"):
        recording = read_recording(Path(options.recording), ruleset)
        truth = read_truth(Path(options.truth), ruleset, recording) if options.truth else None
        diagnosis = diagnose(recording, ruleset, options.mode)
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


def _waiting(out: Console, what: str) -> AbstractContextManager[object]:
    """A spinner while something takes its time, where somebody watches."""
    return out.status(what) if out.is_terminal else contextlib.nullcontext()


def load(path: Path) -> Ruleset:
    """Read a ruleset file, or compile a plant (which alone needs the compiler)."""
    if path.suffix == ".json":
        return read_ruleset(path)
    from rulec.pipeline import compile_plant

    return compile_plant(path)
