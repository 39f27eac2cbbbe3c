"""`rulec compile`: write the ruleset of a plant."""

from __future__ import annotations

import argparse

from rulec_runtime.commands.destinations import console, progress_of, write_to

from rulec.api.compile import compile


def run(options: argparse.Namespace) -> int:
    """Compile a plant to a ruleset file."""
    with progress_of(options, "compiling the plant"):
        found = compile(options.plant)
    target = options.output or f"{found.ruleset.plant}.ruleset.json"
    write_to(target, found.ruleset.to_json())
    found.tell(console(options), target)
    return 0
