"""`python -m rulec.prove`: the command, or the packages it lacks if only rulec is installed."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from rulec_runtime.output.refusal import to_install
from rulec_runtime.output.terminal import say_aside

NEEDS = ("sklearn", "pysindy")
"""Packages that only the suite needs; some are first imported at its end."""


def main(command: str = "rulec.prove.command") -> int:
    """Run the module of a command; returns 1 if packages of the suite are absent."""
    absent = [name for name in NEEDS if find_spec(name) is None]
    if absent:
        say_aside(
            f"rulec prove: {', '.join(absent)} not installed here; the suite needs "
            f"them: {to_install('prove', 'rulec')}"
        )
        return 1
    done: int = import_module(command).main()
    return done


if __name__ == "__main__":
    raise SystemExit(main())
