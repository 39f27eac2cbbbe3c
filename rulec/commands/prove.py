"""`rulec prove`: the suite of concealed effects."""

import argparse
import signal
from importlib import import_module
from pathlib import Path

from rulec_runtime.commands.destinations import console, progress_of, write_json, write_to
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import say_aside, styled
from rulec_runtime.report.page_origin import made_now

from rulec.commands.arguments import folder_of

# The suite lies above the commands, so it is loaded by name.
SUITE, RIGS = "rulec.prove", "rulec.prove.real"


def run(options: argparse.Namespace) -> int:
    """Run the suite; a blind test of a recording needs none. SIGTERM interrupts as Ctrl-C does."""
    if options.blind:
        return _blind(options)
    suite = RIGS if options.real or options.make_rigs else SUITE
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return int(import_module(f"{suite}.command").run(options))
    except KeyboardInterrupt:
        hint = "the same command goes on" if options.keep else "--keep DIR would let it go on"
        say_aside(f"rulec prove: interrupted; {hint}")
        return 130
    finally:
        signal.signal(signal.SIGTERM, before)


def _blind(options: argparse.Namespace) -> int:
    blind = import_module(f"{SUITE}.blind")
    drawn = [name for name in ("hard", "production", "contacts", "only") if getattr(options, name)]
    if drawn:
        raise Misused(f"--{drawn[0]}: a blind test asks for every effect; leave --{drawn[0]} out")
    plant, recording = options.blind
    folder_of(plant)
    with progress_of(options, "reading the plant") as progress:
        found = blind.blind(Path(plant), recording, progress)
    out = console(options)
    blind.show(out, found)
    if options.report:
        write_to(options.report, blind.page(found, made_now("rulec")))
        out.print(styled("[dim]report: {}[/]", options.report))
    write_json(options, found.form())
    return 0
