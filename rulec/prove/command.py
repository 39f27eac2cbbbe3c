"""Prove the mismatch analysis on concealed effects: `rulec prove`."""

import argparse
import functools
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

from rich.console import Console
from rulec_runtime.commands.destinations import without_folder, write_json
from rulec_runtime.commands.frame import quiet_option
from rulec_runtime.output.progress import Progress
from rulec_runtime.output.refusal import Misused, Refusal
from rulec_runtime.output.terminal import styled, terminal
from rulec_runtime.output.write_file import write_text
from rulec_runtime.report.page_origin import made_now

from rulec.cli import prove_options
from rulec.engines.call import Engine
from rulec.engines.engine import chosen
from rulec.prove import contacts
from rulec.prove.campaign import Campaign, Changed, Workers, digest_of, unusable
from rulec.prove.interruption import interruptible
from rulec.prove.page import page, show
from rulec.prove.partition import Partition, register
from rulec.prove.results import Further, Run
from rulec.prove.second_round import arms_of, asked_again, judged_again
from rulec.prove.truth.settled.plan import Planned as Settled

Ask = Callable[[argparse.Namespace, Console, Console], int]
"""Runs the command, given its options and the terminals for results and for messages."""

FIRST_CONTACT = 1
"""Default seed of the first case of first contacts; later cases count up from it."""


def main(words: list[str] | None = None, ask: Ask | None = None) -> int:
    """Run; returns 0 whatever the scores, 1 if the folder holds another run."""
    parser = argparse.ArgumentParser(prog="rulec prove", description=__doc__)
    prove_options(parser)
    quiet_option(parser)
    # `rulec prove` passes this; it holds the other end of standard input.
    parser.add_argument("--lifeline", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(words)
    out, aside = terminal(quiet=options.quiet), terminal(aside=True)
    try:
        with interruptible(options.lifeline):
            return (ask or _asked)(options, out, aside)
    except (Changed, Refusal) as refused:
        return ended(aside, 1, str(refused))
    except OSError as error:
        return ended(aside, 1, f"{error.filename or 'file'}: {error.strerror}")
    except KeyboardInterrupt:
        hint = "the same command goes on" if options.keep else "--keep DIR would let it go on"
        return ended(aside, 130, f"interrupted; {hint}")


def ended(aside: Console, code: int, why: str) -> int:
    """Print why the command ends; returns its exit code."""
    aside.print(f"rulec prove: {why}", markup=False, soft_wrap=True)
    return code


def _asked(options: argparse.Namespace, out: Console, aside: Console) -> int:
    if (mistake := _mistake(options)) is not None:
        return ended(aside, 2, mistake)
    with tempfile.TemporaryDirectory(prefix="rulec-prove-") as temporary:
        # Absolute, because the workers of a cluster run in other working directories.
        work = Path(options.keep or temporary).absolute()
        if options.contacts:
            return _contacts(options, work, out, aside)
        run = _run(options, work, aside)
    show(out, run)
    if options.json:
        write_text(Path(options.json), run.to_json())
    if options.report:
        write_text(Path(options.report), page(run, made_now("rulec")))
        out.print(styled("[dim]report: {}[/]", options.report))
    return 0


def _contacts(options: argparse.Namespace, work: Path, out: Console, aside: Console) -> int:
    with Progress("rulec prove", "sealing", options.quiet, aside) as on_progress:
        run = Campaign(partition_of(options)[0], work, Workers(engine_of(options), on_progress))
        run.analysed(seals := run.sealed())
        found = contacts.judged(run, seals)
    contacts.show(out, found)
    write_json(options, contacts.form_of(found))
    return 0


def _mistake(options: argparse.Namespace) -> str | None:
    """Return the first mistake in the options, before the long work starts."""
    try:
        engine_of(options)
    except Misused as misused:
        return str(misused)
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
        "--report: there is no page of first contacts, a table and --json only": (
            contacts_ and options.report
        ),
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
    known = register()
    made = functools.partial(
        Partition,
        only=options.only,
        hard=options.hard,
        produced=options.production,
        contacts=options.contacts,
    )
    if options.final:
        final = known["final"]
        return made("final", final["seed"], False), final["opened"]
    own = FIRST_CONTACT if options.contacts else known["development"]["seed"]
    seed = own if options.seed is None else options.seed
    return made("development", seed, options.quick), 0


def _run(options: argparse.Namespace, work: Path, aside: Console) -> Run:
    begin = time.perf_counter()
    partition, openings = partition_of(options)
    arms, further = arms_of(options.baselines), list[Further]()
    with Progress("rulec prove", "sealing", options.quiet, aside) as on_progress:
        run = Campaign(partition, work, Workers(engine_of(options), on_progress))
        seals = run.sealed()
        digest = digest_of(seals)
        made = sum(bool(s) for s in seals)
        aside.print(f"{made} answers sealed, hash {digest[:16]}")
        run.analysed(seals)
        if options.rounds > 1:
            asked_again(run, seals, arms)
        found = run.judged(seals)
        if options.rounds > 1:
            further = judged_again(run, seals, found, arms)
    lost = len(seals) - made
    notes = (f"{lost} planned cases had no plant that shows them",) if lost else ()
    return Run(
        tuple(found),
        seeds={partition.name: str(partition.seed)},
        openings=openings,
        digest=digest,
        version=version("rulec"),
        seconds=time.perf_counter() - begin,
        notes=notes,
        further=tuple(further),
    )
