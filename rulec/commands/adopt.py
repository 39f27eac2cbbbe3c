"""`rulec adopt`: write the plant that a mismatch asks for."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rulec_runtime.commands.destinations import console
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.mending import mended
from rulec_runtime.recordings.together import read_recordings
from rulec_runtime.report.text import number

from rulec.commands.made_from import AGAIN, check_unchanged
from rulec.effects.adopt import Adoption
from rulec.effects.adopted_plant import adoption_of, put_in_place, write_plant
from rulec.effects.model_builder import open_builder
from rulec.effects.repair import AdoptRefused, Proven, Reported, read_proven, read_repair
from rulec.language.diagnostics import Refused
from rulec.limits import ADOPTED_AGREEMENT
from rulec.mismatch.answer.public import row_errors, simulated
from rulec.passes.pipeline import compile_plant
from rulec.simulation.equations import SimulationRefused


def run(options: argparse.Namespace) -> int:
    """Check, write to a temporary folder, try that plant out, move it into place, and summarise."""
    out, target, file = console(options), Path(options.output), Path(options.mismatch)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise AdoptRefused(f"{target} is not empty; name a new folder")
    repair = read_repair(file, options.recalibrated)
    proven = read_proven(file, options.recalibrated)
    if proven.edits:
        raise AdoptRefused(not_connected_so(proven.edits))
    if proven.refused:
        raise AdoptRefused(
            f"nothing is written: {proven.refused}. The plant with recalibrated values alone can "
            "be written with --recalibrated"
        )
    if proven.basis is None:
        raise AdoptRefused(f"{file}: it does not say which files it was made from; {AGAIN}")
    if not repair.joined and not options.recalibrated:
        reasons = "; ".join(f"{name}: {why}" for name, why in proven.left_out)
        raise AdoptRefused(
            f"nothing was found that a model may hold{f' ({reasons})' * bool(reasons)}; "
            "recalibrated values alone can be written with --recalibrated"
        )
    _, builder = open_builder(repair.plant)
    assert builder.sources is not None
    recordings = check_unchanged(proven.basis, builder.sources)
    adoption = adoption_of(builder, repair)
    with put_in_place(target) as folder:
        write_plant(folder, builder.sources, adoption, repair)
        try_out(folder, recordings, proven)
    _tell(out, target, adoption, proven)
    return 0


def not_connected_so(edits: Sequence[str]) -> str:
    """Why nothing is done for a plant whose file says otherwise what feeds what, and the remedy."""
    todo = ". ".join(f"{edit[0].upper()}{edit[1:]}" for edit in edits)
    return (
        "nothing is written: the plant file says otherwise than the readings what feeds what, and "
        f"it is the engineer's. {todo}. Then run rulec mismatch again"
    )


def try_out(plant: Path, recordings: Sequence[Path], proven: Proven) -> None:
    """Compile a plant, simulate the recordings, and compare with the errors reported.

    Raises `AdoptRefused` where it does not hold.
    """
    try:
        ruleset = compile_plant(plant)
    except Refused as error:
        raise AdoptRefused(f"what was to be written does not compile: {error}") from None
    if not proven.checks:
        return
    readings = read_recordings(recordings, ruleset)
    lacking = [n for m in proven.misread for n in m.signals if n not in readings.values]
    if lacking:
        raise AdoptRefused(f"{lacking[0]} is not in the recording any more; {AGAIN}")
    readings = mended(readings, proven.misread)
    try:
        found = row_errors(ruleset, simulated(ruleset, readings), readings, proven.heldout)
    except SimulationRefused as error:
        raise AdoptRefused(f"what was to be written cannot be simulated: {error}") from None
    for name, reported in proven.checks.items():
        off = found.get(name, (math.nan, 0))[0]
        if not abs(off - reported) <= ADOPTED_AGREEMENT * max(abs(reported), 1e-12):
            unit = ruleset.signal_by_id[name].unit if name in ruleset.signal_by_id else ""
            raise AdoptRefused(
                f"nothing is written: simulated over the held-out parts of the recording, {name} "
                f"is off by {number(off)} {unit}, and {number(reported)} {unit} was found in the "
                f"analysis; {AGAIN}"
            )


def _tell(out: Console, target: Path, adoption: Adoption, proven: Proven) -> None:
    for candidate in adoption.taken:
        kind = adoption.instances[candidate.module].type
        what = f"{candidate.module}: {candidate.title}, in {kind.name} version {kind.version}"
        out.print(styled("[green]✓[/] {}", what))
        out.print(f"  {candidate.equation}", soft_wrap=True)
    for name, reason in proven.left_out:
        out.print(styled("[yellow]![/] not adopted: {}: {}", name, reason))
    if not adoption.taken:
        out.print("values only: no equation was changed")
    for line in _errors(proven.reported, bool(adoption.taken)):
        out.print(line, soft_wrap=True)
    out.print(styled("[green]✓[/] {}: a plant like any other", target))


def _errors(reported: Sequence[Reported], amended: bool) -> list[str]:
    """Errors of the new plant on held-out samples."""
    lines = []
    for part in reported:
        if part.points and math.isfinite(part.own):
            unit = "" if part.unit == "1" else f" {part.unit}"
            than = f", recalibrated alone by {number(part.recalibrated)}{unit}" * amended
            lines.append(
                f"simulated on {part.points} held-out samples, {part.signal} is off by "
                f"{number(part.own)}{unit}{than}"
            )
    return lines
