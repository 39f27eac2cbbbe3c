"""`rulec show`: what a compiler pass made, in readable form."""

from __future__ import annotations

import argparse
import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path

from rulec_runtime.commands.destinations import console
from rulec_runtime.output.refusal import Misused

from rulec.passes.compile_cache import kept_of_plant

KNOWLEDGE = "knowledge"


def run(options: argparse.Namespace) -> int:
    """Run the passes up to the named one and print its result."""
    plant = None if options.plant is None else Path(options.plant)
    out = console(options)
    for line in _told(options.step, plant):
        out.print(line, soft_wrap=True)
    return 0


def _told(step: str, plant: Path | None) -> Iterable[str]:
    """Lines to print; those about a plant are known from an earlier start."""
    if step == KNOWLEDGE:
        from rulec.commands.show_knowledge import listing  # reads YAML

        return listing(plant)
    if plant is None or not step.isidentifier():
        return _asked(step, plant)()
    lines: Iterable[str] = kept_of_plant(
        plant, f"shown-{step}-{_here()}", lambda: list(_asked(step, plant)())
    )
    return lines


def _here() -> str:
    """The working folder, from which places of files are told, as a part of a name."""
    return hashlib.sha256(str(Path.cwd()).encode("utf-8", "surrogateescape")).hexdigest()[:12]


def _asked(asked: str, plant: Path | None) -> Callable[[], Iterable[str]]:
    """What tells about a step, by its name or a word of it; `Misused` where there is none."""
    from rulec.commands.show_steps import STEPS, lines_of  # loads the compiler
    from rulec.language.diagnostics import did_you_mean

    short = [name for name in STEPS if asked in name.split("_")]
    step = short[0] if len(short) == 1 else asked
    if step == "passes":
        return lambda: (
            "passes in order: " + ", ".join(STEPS),
            f"besides: {KNOWLEDGE}, all that is known of equipment, and where it stands",
        )
    if step not in STEPS:
        hint = did_you_mean(step, [*STEPS, KNOWLEDGE])
        what = f"there is no pass '{step}'"
        raise Misused(f"{what}; {hint}; 'rulec show passes' lists all of them")
    if plant is None:
        raise Misused(f"which plant? give rulec show {step} PLANT")
    return lambda: lines_of(step, plant)
