"""The command `rulec-runtime`: what an operator station does with a compiled ruleset."""

from collections.abc import Sequence
from pathlib import Path

from rulec_runtime.commands.frame import Commands, prepare_process, run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (0 done, 1 bad input, 2 usage, 3 see help)."""
    prepare_process()
    parser = Commands(Path(__file__).with_name("commands.toml")).parser()
    return run_command(parser.parse_args(arguments), "rulec_runtime", parser.prog)
