"""What `rulec prove --real` and `--make-rigs` do."""

from __future__ import annotations

import argparse
import dataclasses
import hashlib
import json
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rulec_runtime.commands.destinations import without_folder, write_json
from rulec_runtime.output.progress import Progress
from rulec_runtime.output.terminal import styled
from rulec_runtime.output.write_file import write_text
from rulec_runtime.report.made import made_now

from rulec.engines.call import Engine
from rulec.prove import command as suite
from rulec.prove.campaign import OnProgress, owned, spread
from rulec.prove.limits import PATIENCE
from rulec.prove.real.ask import ask, lay_out
from rulec.prove.real.form import Rig, false_alarms_in, rigs_in
from rulec.prove.real.hide import differences, hide
from rulec.prove.real.make import made
from rulec.prove.real.score import scored
from rulec.prove.real.told import Result, form, page, tell
from rulec.prove.run_folder import CASES, unusable

NAMES = "names.json"
"""New names of modules by the old ones, beside the folder that has them."""


def main(words: list[str] | None = None) -> int:
    """Run; 0 when done, whatever the scores."""
    return suite.main(words, _asked)


def _asked(options: argparse.Namespace, out: Console, aside: Console) -> int:
    mistake = _mistake(options)
    if mistake is not None:
        return suite.ended(aside, 2, mistake)
    if options.make_rigs:
        return _make(options, out)
    with tempfile.TemporaryDirectory(prefix="rulec-prove-") as temporary:
        return _prove(options, Path(options.keep or temporary).absolute(), out, aside)


def _mistake(options: argparse.Namespace) -> str | None:
    """What is wrong with the options; asked before the long work."""
    drawn = [name for name in ("hard", "production", "contacts") if getattr(options, name)]
    if drawn:
        return f"--{drawn[0]}: real recordings are not drawn; leave --{drawn[0]} out"
    if options.rounds > 1:
        return "--rounds: a recording that is here cannot be made again; leave --real out"
    unwritable = without_folder(options, "json", "report")
    return unwritable or (unusable(Path(options.keep)) if options.keep else None)


def _make(options: argparse.Namespace, out: Console) -> int:
    """Make rigs from recipes; says which were left out, and why; 1 where that is all of them."""
    recipes, source, target = map(Path, options.make_rigs)
    target.mkdir(parents=True, exist_ok=True)
    count = 0
    for name, why in made(recipes, source, target):
        count += not why
        out.print(f"{name}: left out, {why}" if why else f"{name}: made", markup=False)
    return 0 if count else 1


def _prove(options: argparse.Namespace, work: Path, out: Console, aside: Console) -> int:
    """Ask about every rig, judge, and tell."""
    folder, engine = Path(options.real), suite.engine_of(options)
    rigs = rigs_in(folder, options.only)
    digest = sealed(rigs)
    aside.print(f"{sum(bool(r.seal) for r in rigs)} answers sealed, hash {digest[:16]}")
    with Progress("rulec prove", "asking", options.quiet, aside) as on_progress:
        result = judged(rigs, folder, work, options, engine, on_progress)
    tell(out, result)
    write_json(options, form(result))
    if options.report:
        write_text(Path(options.report), page(result, made_now("rulec")))
        out.print(styled("[dim]report: {}[/]", options.report))
    return 0


def sealed(rigs: Sequence[Rig]) -> str:
    """One hash over the seals of all rigs, and what each is shown."""
    lines = (f"{rig.name} {rig.seal}" for rig in rigs)
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def judged(
    rigs: Sequence[Rig],
    folder: Path,
    work: Path,
    options: argparse.Namespace,
    engine: Engine,
    on_progress: OnProgress,
) -> Result:
    """Ask about all rigs, each in a numbered folder, and open the answers."""
    owned(work, f"real recordings {sealed(rigs)}")
    limit = options.limit or PATIENCE
    todo: list[tuple[Any, ...]] = [
        # What asks does not hold the answer either.
        (
            dataclasses.replace(rig, truth=None),
            work / CASES / f"{i:04d}",
            limit,
            options.hidden_names,
        )
        for i, rig in enumerate(rigs)
    ]
    asked = list(spread(_ask, todo, engine, lambda n: on_progress("asking", n, len(todo))))
    digest = sealed(rigs)
    hidden = {r.name: d for r, (_, d) in zip(rigs, asked, strict=True)}
    return Result(
        tuple(scored(rig, found) for rig, (found, _) in zip(rigs, asked, strict=True)),
        false_alarms_in(folder),
        hidden if options.hidden_names else None,
        digest,
    )


def _ask(rig: Rig, folder: Path, limit: float, hidden: bool) -> tuple[Mapping[str, Any], list[str]]:
    """What the tool says of a rig, and what it says otherwise under other names."""
    lay_out(rig, folder)
    other = folder.with_name(f"{folder.name}-hidden")
    if hidden and not (other / NAMES).exists():
        shutil.rmtree(other, ignore_errors=True)
        lay_out(rig, other)
        write_text(other / NAMES, json.dumps(hide(other)))
    open_ = ask(folder, rig.test, limit)
    if not hidden:
        return open_, []
    found = ask(other, None, limit)
    if not open_["form"] or not found["form"]:
        names = [re.sub(r"\d+ s", "", one["error"]) for one in (open_, found)]
        return open_, [] if names[0] == names[1] else [f"{names[0]} → {names[1]}"]
    names_of = json.loads((other / NAMES).read_text(encoding="utf-8"))
    return open_, differences(open_["form"], found["form"], names_of)
