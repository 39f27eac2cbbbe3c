"""`rulec completion`: what makes a shell complete commands, options and names of files."""

from __future__ import annotations

import argparse

from argcomplete.shell_integration import shellcode
from rulec_runtime.output.terminal import write_document

COMMAND = "rulec"


def run(options: argparse.Namespace) -> int:
    """Write a script for a shell to standard output; the shell is to read it when it starts."""
    write_document(f"{shellcode([COMMAND], shell=options.shell).strip()}\n")
    return 0
