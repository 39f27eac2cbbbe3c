"""`rulec completion`: a script that makes a shell complete commands, options and file names."""

import argparse

from argcomplete.shell_integration import shellcode
from rulec_runtime.output.terminal import write_document


def run(options: argparse.Namespace) -> int:
    """Write the script to standard output; the shell must read it when it starts."""
    write_document(f"{shellcode(['rulec'], shell=options.shell).strip()}\n")
    return 0
