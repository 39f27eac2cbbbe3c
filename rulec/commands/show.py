"""`rulec show`: the result of a compiler pass, in readable form."""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.nearest import did_you_mean
from rulec_runtime.output.refusal import Misused

from rulec.passes.compile_cache import kept_of_plant

KNOWLEDGE = "knowledge"


def run(options: argparse.Namespace) -> int:
    """Run the passes up to the named one and print its result."""
    plant = None if options.plant is None else Path(options.plant)
    out = console(options)
    for line in _lines(options.step, plant):
        out.print(line, soft_wrap=True)
    return 0


def _lines(step: str, plant: Path | None) -> Iterable[str]:
    """Lines to print; those about a plant are cached."""
    if step == KNOWLEDGE:
        from rulec.commands.show_knowledge import listing  # reads YAML

        return listing(plant)
    if plant is None or not step.isidentifier():
        return _printer(step, plant)()
    # Lines name places of files relative to the working folder.
    here = hashlib.sha256(str(Path.cwd()).encode("utf-8", "surrogateescape")).hexdigest()[:12]
    lines: Iterable[str] = kept_of_plant(
        plant, f"shown-{step}-{here}", lambda: list(_printer(step, plant)())
    )
    return lines


def _printer(asked: str, plant: Path | None) -> Callable[[], Iterable[str]]:
    """What gives the lines of a step, by its name or a word of it; raises `Misused` for others."""
    from rulec.commands.show_steps import STEPS, lines_of  # loads the compiler

    short = [name for name in STEPS if asked in name.split("_")]
    step = short[0] if len(short) == 1 else asked
    if step == "passes":
        return lambda: (
            "passes in order: " + ", ".join(STEPS),
            f"also: {KNOWLEDGE}, all known equipment and where it is defined",
        )
    if step not in STEPS:
        hint = did_you_mean(step, [*STEPS, KNOWLEDGE])
        raise Misused(f"there is no pass '{step}'; {hint}; 'rulec show passes' lists all of them")
    if plant is None:
        raise Misused(f"which plant? give rulec show {step} PLANT")
    return lambda: lines_of(step, plant)
