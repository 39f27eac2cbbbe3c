"""`rulec compile`: write the ruleset of a plant."""

from __future__ import annotations

import argparse
from pathlib import Path

from rulec.commands.output import console, write_text
from rulec.pipeline import compile_plant


def run(options: argparse.Namespace) -> int:
    """Compile a plant to a ruleset file."""
    ruleset = compile_plant(Path(options.plant))
    target = Path(options.output or f"{ruleset.plant}.ruleset.json")
    write_text(target, ruleset.to_json())
    out = console(options)
    out.print(
        f"[green]✓[/] {target}: {len(ruleset.modules)} modules, {len(ruleset.residuals)} "
        f"residuals, {len(ruleset.faults)} faults, {len(ruleset.cells)} rules"
    )
    for name in ruleset.unobserved:
        out.print(f"[yellow]![/] {name} leaves no trace in any residual; it needs a further sensor")
    return 0
