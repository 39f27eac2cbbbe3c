"""`rulec export`: write the observers of a plant's modules as code for their controllers."""

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.plural import plural
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.recording import read_recording

from rulec.commands.arguments import ruleset_of
from rulec.export.c_printer import header, source
from rulec.export.module_code import code_of, wiring_csv
from rulec.export.play_on_recording import played, results_csv
from rulec.export.program import ModuleCode
from rulec.export.st_printer import blocks

WIRING, RESULTS = "wiring.csv", "results.csv"


def run(options: argparse.Namespace) -> int:
    """Write the code and its wiring; with a recording, also the results of the code on it."""
    out = console(options)
    ruleset = ruleset_of(options.plant)
    folder = Path(options.output)
    recording = None if options.play is None else read_recording(Path(options.play), ruleset)
    codes = code_of(ruleset)
    folder.mkdir(parents=True, exist_ok=True)
    lines = 0
    for name, text in files_of(codes, options.to):
        write_text(folder / name, text)
        lines += text.count("\n")
    write_text(folder / WIRING, wiring_csv(codes))
    counts = plural(len(codes), "module", "modules"), plural(lines, "line", "lines")
    out.print(styled("[green]✓[/] {}: {}, {}, and {}", folder, *counts, WIRING))
    written = {code.module for code in codes}
    others = ", ".join(name for name in ruleset.modules if name not in written)
    if others:
        note = "[dim]note: without estimates of their flow, and so without code: {}[/]"
        out.print(styled(note, others))
    if ruleset.dynamics is not None:
        note = "this plant has storage: rulec diagnose judges its recordings, not module results"
        out.print(styled("[dim]note: {}[/]", note))
    if recording is not None:
        columns = played(recording, ruleset, codes)
        write_text(folder / RESULTS, results_csv(columns))
        windows = plural(len(columns["samples"]), "window", "windows")
        out.print(styled("[green]✓[/] {}: {}", folder / RESULTS, windows))
    return 0


def files_of(codes: Iterable[ModuleCode], language: str) -> Iterator[tuple[str, str]]:
    """Names and texts of the files of all modules."""
    for code in codes:
        if language == "c":
            yield f"{code.name}.h", header(code)
            yield f"{code.name}.c", source(code)
        else:
            yield f"{code.name}.st", blocks(code)
