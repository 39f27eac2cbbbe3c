"""`rulec experiment`: the set points that tell apart what a mismatch leaves open."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from rulec_runtime.commands.destinations import console, write_json
from rulec_runtime.output.json_file import Damaged, read_json
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.recordings.mending import mended
from rulec_runtime.recordings.together import read_recordings

from rulec.commands.adopt import not_connected_so
from rulec.commands.made_from import AGAIN, check_unchanged
from rulec.effects.model_builder import open_builder
from rulec.effects.repair import read_proven, read_repair
from rulec.mismatch.experiment.page import experiment_page
from rulec.mismatch.experiment.plan import ExperimentRefused, planned
from rulec.mismatch.experiment.recipe import tell
from rulec.mismatch.experiment.written import experiment_form, inputs_csv
from rulec.mismatch.result import Presence, Standing
from rulec.separation.limits_file import read_limits


def run(options: argparse.Namespace) -> int:
    """Plan, tell, and write the input file."""
    out, file = console(options), Path(options.mismatch)
    standing = _standing(file)
    proven = read_proven(file)
    if proven.basis is None:
        raise ExperimentRefused(f"{file}: it does not say which files it was made from; {AGAIN}")
    if proven.edits:
        raise ExperimentRefused(not_connected_so(proven.edits))
    ruleset, builder = open_builder(read_repair(file, recalibrated=True).plant)
    assert builder.sources is not None
    recording = read_recordings(check_unchanged(proven.basis, builder.sources), ruleset)
    found = planned(
        mended(recording, proven.misread),
        ruleset,
        builder,
        standing,
        options.steps,
        3600.0 * options.hours,
        given=None if options.limits is None else read_limits(Path(options.limits), ruleset),
    )
    tell(out, found, ruleset)
    if options.output and found.steps:
        write_text(Path(options.output), inputs_csv(found, ruleset))
        out.print(styled("[dim]inputs for rulec simulate: {}[/]", options.output))
    elif options.output:
        out.print(styled("[dim]{} is not written: there is no step[/]", options.output))
    if options.report:
        write_text(Path(options.report), experiment_page(found, ruleset))
        out.print(styled("[dim]report: {}[/]", options.report))
    write_json(options, experiment_form(found, ruleset))
    return 0


def _standing(file: Path) -> tuple[Standing, ...]:
    """What a mismatch left standing; raises ExperimentRefused where the file does not say."""
    try:
        data = read_json(file)
        every = data["standing"]
        found = tuple(_one(one) for one in every)
    except Damaged as error:
        raise ExperimentRefused(
            f"{file}: this is not JSON ({error}); write it with rulec mismatch"
        ) from None
    except (LookupError, TypeError, ValueError, AttributeError):
        raise ExperimentRefused(
            f"{file}: it does not say which explanations stand; {AGAIN}"
        ) from None
    if not found:
        raise ExperimentRefused(
            f"{file}: no sets of explanations were weighed. In plants that store they are not; a "
            "recording that cannot be judged has none"
        )
    return found


def _one(data: dict[str, Any]) -> Standing:
    return Standing(
        names=tuple(str(name) for name in data["names"]),
        titles=tuple(str(title) for title in data["titles"]),
        probability=float(data["probability"]),
        joined=tuple(str(id_) for id_ in data["joined"]),
        values={str(name): float(value) for name, value in data["values"].items()},
        fixed={str(name): float(value) for name, value in data["fixed"].items()},
        periods=tuple(
            Presence(
                str(p["unknown"]),
                tuple((float(a), float(b), int(level)) for a, b, level in p["spans"]),
                bool(p["grows"]),
            )
            for p in data["periods"]
        ),
        released=tuple(str(name) for name in data["released"]),
        trusted=tuple(str(name) for name in data["trusted"]),
        terms=tuple((str(name), float(length)) for name, length in data["terms"]),
    )
