"""`rulec prove`: the suite of concealed effects, in a process of its own."""

import argparse
import signal
import subprocess
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from rulec_runtime.commands.destinations import console, progress_of, write_json, write_to
from rulec_runtime.output.refusal import Misused
from rulec_runtime.output.terminal import styled
from rulec_runtime.report.page_origin import made_now

from rulec.commands.arguments import folder_of

SUITE, RIGS = "rulec.prove", "rulec.prove.real"


def run(options: argparse.Namespace) -> int:
    """Start the suite with the same options; a blind test of a recording needs no suite."""
    if options.blind:
        return _blind(options)
    suite = RIGS if options.real or options.make_rigs else SUITE
    return _waited_for([sys.executable, "-m", suite, "--lifeline", *options.words[1:]])


def _blind(options: argparse.Namespace) -> int:
    # The suite lies above the commands, so it is loaded by name.
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


def _waited_for(asked: Sequence[str]) -> int:
    """Exit code of the suite.

    The suite has a session of its own, so an interrupt reaches this process alone. The pipe to it
    is its lifeline: it ends its workers and itself when this end closes, be it by a signal, here,
    or because this process was killed.
    """
    with subprocess.Popen(asked, stdin=subprocess.PIPE, start_new_session=True) as suite:
        before = signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            return suite.wait()
        except KeyboardInterrupt:
            assert suite.stdin is not None
            suite.stdin.close()
            return suite.wait()
        finally:
            signal.signal(signal.SIGTERM, before)
