"""`rulec adopt`: the plant that a mismatch asks for, as a new folder."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import Console
from rulec_runtime.commands.destinations import STANDARD_OUTPUT, console, progress_of
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.recordings.header_correction import mended
from rulec_runtime.report.text import number

from rulec.commands.mismatch import MismatchResult, Reread, reread
from rulec.commands.result import AnyPath, Columns, Result, parts_of
from rulec.effects.repair import AGAIN, AdoptRefused, Proven, why_refused
from rulec.language.diagnostics import Refused
from rulec.limits import ADOPTED_AGREEMENT
from rulec.simulation.equations import SimulationRefused

if TYPE_CHECKING:
    from rulec.effects.adopt import Adoption


@dataclass(frozen=True, kw_only=True)
class AdoptResult(Result):
    """A new plant folder, used like any other.

    Attributes
    ----------
    plant : the folder.
    adoption : types of all modules, and the adopted explanations.
    proven : what the analysis found about the same plant before it was written.

    Table: `errors`, held-out errors of the predictions of the new plant.
    """

    plant: Path
    adoption: Adoption
    proven: Proven

    def __repr__(self) -> str:
        return f"<AdoptResult {self.plant}: {len(self.adoption.taken)} explanations>"

    def to_dict(self) -> dict[str, Any]:
        """What was adopted, what was not and why, and held-out errors in their units."""
        return {
            "plant": self.plant.as_posix(),
            "taken": [
                {"id": c.id, "module": c.module, "title": c.title, "equation": c.equation}
                for c in self.adoption.taken
            ],
            "left_out": [{"id": name, "reason": why} for name, why in self.proven.left_out],
            "errors": [
                {k: None if v != v else v for k, v in vars(part).items()}
                for part in self.proven.reported
            ],
        }

    def tell(self, out: Console) -> None:
        """Print what was adopted, what was not, and how good the new plant is."""
        for candidate in self.adoption.taken:
            kind = self.adoption.instances[candidate.module].type
            what = f"{candidate.module}: {candidate.title}, in {kind.name} version {kind.version}"
            out.print(styled("[green]✓[/] {}", what))
            out.print(f"  {candidate.equation}", soft_wrap=True)
        for name, reason in self.proven.left_out:
            out.print(styled("[yellow]![/] not adopted: {}: {}", name, reason))
        if not self.adoption.taken:
            out.print("values only: no equation was changed")
        for part in self.proven.reported:
            if part.points and math.isfinite(part.own):
                unit = "" if part.unit == "1" else f" {part.unit}"
                than = f" ({number(part.recalibrated)}{unit} with recalibration only)"
                out.print(
                    f"on {part.points} held-out samples {part.signal} is off by "
                    f"{number(part.own)}{unit}{than * bool(self.adoption.taken)}"
                )
        out.print(styled("[green]✓[/] {}: ready to use as PLANT", self.plant))

    def _reported(self) -> Columns:
        names = ("signal", "unit", "recalibrated", "own", "points")
        return parts_of(names, self.proven.reported)

    _tables: ClassVar = {"errors": _reported}


def adopt(
    mismatch: MismatchResult | AnyPath, folder: AnyPath, *, recalibrated: bool = False
) -> AdoptResult:
    """Write the plant that a mismatch asks for, with amended module types.

    Parameters
    ----------
    mismatch : what `rulec.mismatch` returned, or a JSON file of `rulec mismatch`.
    folder : new folder, for use as a plant.
    recalibrated : write only the plain model with recalibrated values.

    Raises
    ------
    AdoptRefused
        Nothing may be written, files have changed since, or the new plant fails its test.

    Examples
    --------
    >>> import rulec
    >>> rulec.adopt("day.json", "plants/abc-repaired").plant  # doctest: +SKIP
    PosixPath('plants/abc-repaired')
    """
    target = Path(folder)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise AdoptRefused(f"{target} is not empty; name a new folder")
    source = reread(mismatch, recalibrated)
    repair, proven = source.repair, source.proven
    if why := why_refused(proven.edits, proven.refused):
        beside = ". --recalibrated writes the plant with recalibrated values only"
        raise AdoptRefused(f"nothing written: {why}{'' if proven.edits else beside}")
    source.check_basis(AdoptRefused)
    if not repair.joined and not recalibrated:
        reasons = "; ".join(f"{name}: {why}" for name, why in proven.left_out)
        raise AdoptRefused(
            f"nothing was found that a model may hold{f' ({reasons})' * bool(reasons)}; "
            "--recalibrated writes the plant with recalibrated values only"
        )
    source.check_unchanged()
    builder = source.builder  # loads the compiler, as do these
    from rulec.effects.adopt import adoption_of
    from rulec.effects.write_plant import put_in_place, write_plant

    adoption = adoption_of(builder, repair)
    with put_in_place(target) as made:
        write_plant(made, source.opened.sources, adoption, repair)
        _try_out(made, source)
    return AdoptResult(plant=target, adoption=adoption, proven=proven)


def _try_out(plant: Path, source: Reread) -> None:
    """Compile a plant, simulate the recordings, and compare with the reported errors.

    Raises `AdoptRefused` if they do not agree.
    """
    from rulec.passes.pipeline import compile_plant

    try:
        ruleset = compile_plant(plant)
    except Refused as error:
        why = f"what was to be written does not compile: {error.briefly}"
        raise AdoptRefused(why) from None
    proven = source.proven
    if not proven.checks:
        return
    readings = source.recording(ruleset)
    lacking = [n for m in proven.misread for n in m.signals if n not in readings.values]
    if lacking:
        raise AdoptRefused(f"{lacking[0]} is not in the recording any more; {AGAIN}")
    from rulec.mismatch.answer.written_plant import row_errors, simulated

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
                f"nothing written: over the held-out parts of the recording {name} is off by "
                f"{number(off)} {unit}, but by {number(reported)} {unit} in the analysis; {AGAIN}"
            )


def run(options: argparse.Namespace) -> int:
    """Write the plant and print a summary."""
    if options.output == STANDARD_OUTPUT:
        raise Misused("-o -: a plant is a folder; give its name")
    with progress_of(options, "writing the plant and trying it out"):
        found = adopt(options.mismatch, options.output, recalibrated=options.recalibrated)
    found.tell(console(options))
    return 0
