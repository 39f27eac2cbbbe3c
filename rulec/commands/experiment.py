"""`rulec experiment`: the set points that tell apart what a mismatch leaves open."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from rich.console import Console
from rulec_runtime.commands.destinations import progress_of, show_files, write_to
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.header_correction import mended
from rulec_runtime.report.page_origin import made_now

from rulec.commands.mismatch import MismatchResult, reread
from rulec.commands.result import AnyPath, Columns, PageResult, table_of
from rulec.effects.repair import why_refused
from rulec.mismatch.result import ExperimentRefused

if TYPE_CHECKING:
    from rulec.mismatch.experiment.result import Experiment


@dataclass(frozen=True, kw_only=True)
class ExperimentResult(PageResult):
    """Steps to run, and what each explanation predicts for them.

    Tables: `steps` (a row per step and input), and `readings` (the predictions).
    """

    found: Experiment
    ruleset: Ruleset

    def __repr__(self) -> str:
        return f"<ExperimentResult {self.ruleset.plant}: {len(self.found.steps)} steps>"

    def to_dict(self) -> dict[str, Any]:
        """The experiment as `rulec experiment --json` writes it; times in s."""
        from rulec.mismatch.experiment.result import experiment_form

        return experiment_form(self.found, self.ruleset)

    def inputs_csv(self) -> str:
        """The set points as a recording for `rulec.simulate`; only a header if there is no step."""
        from rulec.mismatch.experiment.result import inputs_csv

        return inputs_csv(self.found, self.ruleset)

    def write_inputs(self, file: AnyPath) -> None:
        """Write the set points as a recording."""
        write_text(Path(file), self.inputs_csv())

    def page(self) -> str:
        """The recipe, one page of HTML with pictures."""
        from rulec.mismatch.experiment.recipe import experiment_page

        return experiment_page(self.found, self.ruleset, made_now("rulec"))

    def tell(self, out: Console) -> None:
        """Print the recipe."""
        from rulec.mismatch.experiment.recipe import tell

        tell(out, self.found, self.ruleset)

    def _steps(self) -> Columns:
        rows = [
            (number, step["from"], step["until"], name, given["value"], given["unit"])
            for number, step in enumerate(self.to_dict()["steps"], 1)
            for name, given in step["inputs"].items()
        ]
        return table_of(("step", "from [s]", "until [s]", "input", "value", "unit"), rows)

    def _readings(self) -> Columns:
        rows = [
            (number, explanation["title"], r["signal"], value, r["unit"])
            for number, step in enumerate(self.to_dict()["steps"], 1)
            for r in step["readings"]
            for explanation, value in zip(self.to_dict()["explanations"], r["values"], strict=True)
        ]
        return table_of(("step", "explanation", "signal", "value", "unit"), rows)

    _tables: ClassVar = {"steps": _steps, "readings": _readings}


def experiment(
    mismatch: MismatchResult | AnyPath,
    *,
    hours: float = 8.0,
    steps: int = 18,
    limits: AnyPath | None = None,
) -> ExperimentResult:
    """Plan set points that tell apart what a mismatch leaves open, and test a sole explanation.

    Parameters
    ----------
    mismatch : what `rulec.mismatch` returned, or a JSON file of `rulec mismatch`.
    hours : longest duration of the experiment.
    steps : largest number of steps.
    limits : file that says how far, how fast and at what cost set points may be changed.

    Raises
    ------
    ExperimentRefused
        Nothing can be set.
    AdoptRefused
        Files have changed since.

    Examples
    --------
    >>> import rulec
    >>> rulec.experiment("day.json", hours=2.0).write_inputs("inputs.csv")  # doctest: +SKIP
    """
    from rulec.mismatch.experiment.result import possible_sets

    source = reread(mismatch, recalibrated=True)
    explanations = possible_sets(source.data, source.file)
    source.check_basis(ExperimentRefused)
    if why := why_refused(source.proven.edits, ""):
        raise ExperimentRefused(f"nothing written: {why}")
    source.check_unchanged()
    ruleset = source.opened.ruleset
    recording = mended(source.recording(ruleset), source.proven.misread)
    from rulec.mismatch.experiment.plan import planned  # loads the compiler
    from rulec.separation.limits_file import read_limits

    found = planned(
        recording,
        ruleset,
        source.builder,
        explanations,
        steps,
        3600.0 * hours,
        given=None if limits is None else read_limits(Path(limits), ruleset),
    )
    return ExperimentResult(found=found, ruleset=ruleset)


def run(options: argparse.Namespace) -> int:
    """Plan, report, and write the input file."""
    with progress_of(options, "planning the experiment"):
        found = experiment(
            options.mismatch, hours=options.hours, steps=options.steps, limits=options.limits
        )
    inputs = options.output if found.found.steps else None
    if inputs:
        write_to(inputs, found.inputs_csv())
    out = found.hand_out(options)
    if options.output and not inputs:
        out.print(styled("[dim]{} is not written: there is no step[/]", options.output))
    show_files(out, {"inputs for rulec simulate": inputs, "report": options.report})
    return 0
