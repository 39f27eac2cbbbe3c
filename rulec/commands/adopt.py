"""`rulec adopt`: write the plant that a mismatch asks for, usable like any other."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from rulec.adopt import Adoption, adopt
from rulec.commands.output import console
from rulec.pipeline import compile_plant
from rulec.read import read_plant
from rulec.repair import AdoptRefused, read_repair
from rulec.workshop import open_workshop
from rulec.write_plant import plant_files
from runtime.terminal import styled
from runtime.write_file import write_text


def run(options: argparse.Namespace) -> int:
    """Write the folder, compile it, and tell what was taken over and what was not."""
    out, target = console(options), Path(options.output)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise AdoptRefused(f"{target} is not empty; name a new folder")
    repair = read_repair(Path(options.mismatch))
    _, workshop = open_workshop(repair.plant)
    adoption = adopt(workshop, workshop.network, repair)
    if not adoption.taken and not repair.parameters:
        reasons = "; ".join(f"{name}: {why}" for name, why in adoption.left)
        raise AdoptRefused(f"there is nothing to adopt{': ' * bool(reasons)}{reasons}")
    for name, text in plant_files(read_plant(repair.plant), adoption, repair):
        file = target / name
        file.parent.mkdir(parents=True, exist_ok=True)
        write_text(file, text)
    compile_plant(target)
    _tell(out, target, adoption)
    return 0


def _tell(out: Console, target: Path, adoption: Adoption) -> None:
    for candidate in adoption.taken:
        kind = adoption.instances[candidate.module].type
        what = f"{candidate.module}: {candidate.title}, in {kind.name} version {kind.version}"
        out.print(styled("[green]✓[/] {}", what))
        out.print(f"  {candidate.equation}", soft_wrap=True)
    for name, reason in adoption.left:
        out.print(styled("[yellow]![/] not adopted: {}: {}", name, reason))
    if not adoption.taken:
        out.print("values only: no equation was changed")
    out.print(styled("[green]✓[/] {}: a plant like any other", target))
