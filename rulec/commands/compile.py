"""`rulec compile`: write the ruleset of a plant."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text

from rulec.passes.pipeline import compile_plant


def run(options: argparse.Namespace) -> int:
    """Compile a plant to a ruleset file."""
    ruleset = compile_plant(Path(options.plant))
    target = Path(options.output or f"{ruleset.plant}.ruleset.json")
    write_text(target, ruleset.to_json())
    out = console(options)
    counts = (
        f"{len(ruleset.modules)} modules, {len(ruleset.residuals)} residuals, "
        f"{len(ruleset.faults)} faults, {len(ruleset.cells)} rules"
    )
    out.print(styled("[green]✓[/] {}: {}", target, counts))
    for name in ruleset.unobserved:
        told = "[yellow]![/] {} leaves no trace in any residual; it needs a further sensor"
        out.print(styled(told, name))
    return 0
