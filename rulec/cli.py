"""The command `rulec`: reads arguments, calls one command, turns mistakes into messages.

This is the one place where compiler and runtime meet. Commands are imported when they are called:
the runtime verbs must start without sympy.
"""

import os
from collections.abc import Sequence
from pathlib import Path

from rulec_runtime.commands import frame

ASKED_BY_SHELL = "_ARGCOMPLETE"
"""Variable by which a shell asks what may come next; see `rulec completion`."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code (0 done, 1 bad input, 2 usage, 3 see help)."""
    frame.prepare_process()
    parser = _commands().parser()
    if ASKED_BY_SHELL in os.environ:
        import argcomplete

        argcomplete.autocomplete(parser)
    return frame.run_command(parser.parse_args(arguments), "rulec", parser.prog)


def _commands() -> frame.Commands:
    shared = Path(frame.__file__).parent.with_name("commands.toml")
    return frame.Commands(Path(__file__).with_name("commands.toml"), shared)


if __name__ == "__main__":
    raise SystemExit(main())
