"""Prove the mismatch analysis on concealed effects: `rulec prove`."""

import argparse
import functools
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from rich.console import Console
from rulec_runtime.commands.destinations import (
    console,
    is_quiet,
    without_folder,
    write_json,
    write_to,
)
from rulec_runtime.output.progress import Progress
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import say_aside, styled
from rulec_runtime.report.page_origin import made_now

from rulec.engines.call import Engine
from rulec.engines.engine import chosen
from rulec.prove.campaign import Campaign, Workers, digest_of, unusable
from rulec.prove.page import page, show
from rulec.prove.partition import Partition, register
from rulec.prove.results import Further, Run
from rulec.prove.scores import scores_form
from rulec.prove.second_round import arms_of, asked_again, judged_again
from rulec.prove.truth.settled.plan import Planned as Settled

FIRST_CONTACT = 1
"""Default seed of the first case of first contacts; later cases count up from it."""


def run(options: argparse.Namespace) -> int:
    """Run; returns 0 whatever the scores. Raises Changed if the folder holds another run."""
    if (mistake := _mistake(options)) is not None:
        raise Misused(mistake)
    with tempfile.TemporaryDirectory(prefix="rulec-prove-") as temporary:
        # Absolute, because the workers of a cluster run in other working directories.
        work = Path(options.keep or temporary).absolute()
        _run(options, work, console(options))
    return 0


def _mistake(options: argparse.Namespace) -> str | None:
    """Return the first mistake in the options, before the long work starts; see `engine_of`."""
    engine_of(options)
    contacts_, again = options.contacts, options.rounds > 1
    undrawn = options.final and register()["final"]["seed"] is None
    cases = [] if undrawn else partition_of(options)[0].cases()
    mistakes = {
        "--final: first contacts are drawn, none is kept apart; leave --final out": (
            options.final and contacts_
        ),
        "--final: the final cases were not drawn yet; --seed N draws cases of your own": undrawn,
        "--hidden-names: this is for real recordings; add --real DIR": options.hidden_names,
        "--limit: this is for real recordings; add --real DIR": options.limit is not None,
        f"--only {options.only}: no case has this in its name": not cases,
        "--baselines: they are asked beside a second recording; add --rounds 2": (
            options.baselines is not None and not again
        ),
        "--rounds: first contacts are asked once; leave --contacts out": again and contacts_,
        "--rounds: how drifts go on is not known; leave --hard out": again and options.hard,
        "--rounds: experiments are planned for settled plants; add --only stationary": (
            again and not all(isinstance(case, Settled) for case in cases)
        ),
    }
    found = next((mistake for mistake, made in mistakes.items() if made), None)
    return found or mistake_of_places(options)


def mistake_of_places(options: argparse.Namespace) -> str | None:
    """Return why results cannot be written, or the kept folder not be used; None if they can."""
    unwritable = without_folder(options, "json", "report")
    return unwritable or (unusable(Path(options.keep)) if options.keep else None)


def engine_of(options: argparse.Namespace) -> Engine:
    """Return the engine that does the work; raises `Misused` for contradictory options."""
    return chosen(options.engine, options.jobs, options.scheduler)


def partition_of(options: argparse.Namespace) -> tuple[Partition, int]:
    """Return the cases, and how often they were opened."""
    registered = register()
    made = functools.partial(
        Partition,
        only=options.only,
        hard=options.hard,
        produced=options.production,
        contacts=options.contacts,
    )
    if options.final:
        final = registered["final"]
        return made("final", final["seed"], False), final["opened"]
    own = FIRST_CONTACT if options.contacts else registered["development"]["seed"]
    seed = own if options.seed is None else options.seed
    return made("development", seed, options.quick), 0


def write_page(options: argparse.Namespace, out: Console, page: Callable[[str], str]) -> None:
    """Write the page of a run to the file of `--report`, if that is given."""
    if options.report:
        write_to(options.report, page(made_now("rulec")))
        out.print(styled("[dim]report: {}[/]", options.report))


def _run(options: argparse.Namespace, work: Path, out: Console) -> None:
    begin = time.perf_counter()
    partition, openings = partition_of(options)
    again, arms, further = options.rounds > 1, arms_of(options.baselines), list[Further]()
    with Progress("rulec prove", "sealing", is_quiet(options)) as on_progress:
        run = Campaign(partition, work, Workers(engine_of(options), on_progress))
        seals = run.sealed()
        digest, lost = digest_of(seals), seals.count("")
        say_aside(f"{len(seals) - lost} answers sealed, hash {digest[:16]}")
        run.analysed(seals)
        if again:
            asked_again(run, seals, arms)
        found = run.judged(seals)
        if again:
            further = judged_again(run, seals, found, arms)
    made = Run(
        tuple(found),
        partition=partition.name,
        seed=partition.seed,
        openings=openings,
        digest=digest,
        version=version("rulec"),
        seconds=time.perf_counter() - begin,
        notes=(f"{lost} planned cases had no plant that shows them",) if lost else (),
        further=tuple(further),
    )
    show(out, made)
    write_json(options, {"scores": scores_form(made.judged), **made.form()})
    write_page(options, out, lambda origin: page(made, origin))
