"""What `rulec prove --real` and `--make-rigs` do."""

import argparse
import dataclasses
import json
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rulec_runtime.commands.destinations import console, is_quiet, write_json
from rulec_runtime.output.progress import Progress
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import say_aside
from rulec_runtime.output.write_file import write_text

from rulec.prove import command as suite
from rulec.prove.campaign import Workers, digest_of, folder_of, owned
from rulec.prove.limits import PATIENCE
from rulec.prove.real.make import made
from rulec.prove.real.renamed_rig import differences, hide
from rulec.prove.real.rig_folder import Rig, false_alarms_in, rigs_in
from rulec.prove.real.run_tool import ask, lay_out
from rulec.prove.real.score import scored
from rulec.prove.real.score_table import Result, form, page, tell

NAMES = "names.json"
"""File with the new name of each module by its old one."""


def run(options: argparse.Namespace) -> int:
    """Run; returns 0 whatever the scores, 1 if no rig was made."""
    for name in ("hard", "production", "contacts"):
        if getattr(options, name):
            raise Misused(f"--{name}: real recordings are not drawn; leave --{name} out")
    if options.rounds > 1:
        raise Misused("--rounds: a recording that is here cannot be made again; leave --real out")
    if (mistake := suite.mistake_of_places(options)) is not None:
        raise Misused(mistake)
    out = console(options)
    if options.make_rigs:
        recipes, source, target = map(Path, options.make_rigs)
        target.mkdir(parents=True, exist_ok=True)
        count = 0
        for name, why in made(recipes, source, target):
            count += not why
            out.print(f"{name}: left out, {why}" if why else f"{name}: made", markup=False)
        return 0 if count else 1
    with tempfile.TemporaryDirectory(prefix="rulec-prove-") as temporary:
        work = Path(options.keep or temporary).absolute()
        rigs = rigs_in(Path(options.real), options.only)
        say_aside(f"{sum(bool(r.seal) for r in rigs)} answers sealed, hash {sealed(rigs)[:16]}")
        with Progress("rulec prove", "asking", is_quiet(options)) as on_progress:
            result = judged(rigs, work, options, Workers(suite.engine_of(options), on_progress))
        tell(out, result)
        write_json(options, form(result))
        suite.write_page(options, out, lambda origin: page(result, origin))
    return 0


def sealed(rigs: Sequence[Rig]) -> str:
    """Return one hash over the names and seals of all rigs."""
    return digest_of([f"{rig.name} {rig.seal}" for rig in rigs])


def judged(
    rigs: Sequence[Rig], work: Path, options: argparse.Namespace, workers: Workers
) -> Result:
    """Run the tool on all rigs, each in a numbered folder, then score its answers."""
    digest = sealed(rigs)
    owned(work, f"real recordings {digest}")
    limit, renamed = options.limit or PATIENCE, options.hidden_names
    todo: list[tuple[Any, ...]] = [
        # The processes that run the tool get no answer either.
        (dataclasses.replace(rig, truth=None), folder_of(work, i), limit, renamed)
        for i, rig in enumerate(rigs)
    ]
    asked = workers.each("asking", _ask, todo)
    changed = {r.name: d for r, (_, d) in zip(rigs, asked, strict=True)}
    return Result(
        tuple(scored(rig, found) for rig, (found, _) in zip(rigs, asked, strict=True)),
        false_alarms_in(Path(options.real)),
        changed if renamed else None,
        digest,
    )


def _ask(rig: Rig, folder: Path, limit: float, rename: bool) -> tuple[Mapping[str, Any], list[str]]:
    """Return the tool's answer for a rig, and how it differs under other names."""
    lay_out(rig, folder)
    other = folder.with_name(f"{folder.name}-hidden")
    if rename and not (other / NAMES).exists():
        shutil.rmtree(other, ignore_errors=True)
        lay_out(rig, other)
        write_text(other / NAMES, json.dumps(hide(other)))
    shown = ask(folder, rig.test, limit)
    if not rename:
        return shown, []
    found = ask(other, None, limit)
    if not shown["form"] or not found["form"]:
        errors = [re.sub(r"\d+ s", "", one["error"]) for one in (shown, found)]
        return shown, [] if errors[0] == errors[1] else [f"{errors[0]} → {errors[1]}"]
    names = json.loads((other / NAMES).read_text(encoding="utf-8"))
    return shown, differences(shown["form"], found["form"], names)
