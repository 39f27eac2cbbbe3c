"""The command `rulec-runtime`: what an operator station does with a compiled ruleset."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module

from rulec_runtime.commands.frame import (
    Parser,
    carried_out,
    diagnose_options,
    journal_options,
    prepare_process,
    quiet_option,
    version_option,
    watch_options,
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (0 done, 1 bad input, 2 usage, 3 see help)."""
    prepare_process()
    parser = Parser(
        prog="rulec-runtime",
        description="Diagnose a plant, also while it runs, with a ruleset from rulec compile.",
        epilog="Exit code: 0 done, 1 bad input, 2 wrong usage; 3 if diagnose was partly blind, "
        "or as --fail-on says.",
    )
    version_option(parser, "rulec-runtime")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    text = "judge a recording: which fault, how large, and why"
    diagnose_options(commands.add_parser("diagnose", help=text), "RULESET.json")
    text = "judge a plant while it runs, and report what begins, grows and ends"
    watch_options(commands.add_parser("watch", help=text), "RULESET.json")
    text = "list, filter and export the events of a watched plant"
    journal_options(commands.add_parser("journal", help=text))
    for command in commands.choices.values():
        quiet_option(command)
    options = parser.parse_args(arguments)

    def run() -> int:
        return int(import_module(f"rulec_runtime.commands.{options.command}").run(options))

    return carried_out(run, f"rulec-runtime {options.command}")
