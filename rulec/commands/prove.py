"""`rulec prove`: the suite of concealed effects, which lives with the independent truth in `tests`.

The truth that makes the cases shares no code with this package, so it is started as a process.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from rulec_runtime.output.terminal import say_aside

SOURCE = Path(__file__).parents[2]
SUITE = "tests.prove"


def run(options: argparse.Namespace) -> int:
    """Start the suite with the same options."""
    if not (SOURCE / "tests" / "prove" / "__main__.py").exists():
        say_aside(
            "rulec prove: the suite is part of the project's source tree, not of the installed "
            "package; clone the project and run it there"
        )
        return 1
    path = os.pathsep.join(filter(None, [str(SOURCE), os.environ.get("PYTHONPATH")]))
    asked = [sys.executable, "-m", SUITE, "--lifeline", *words_of(options)]
    return _waited_for(asked, {**os.environ, "PYTHONPATH": path})


def _waited_for(asked: Sequence[str], environment: Mapping[str, str]) -> int:
    """Exit code of the suite.

    It is a session of its own, so an interrupt reaches this process alone. The pipe to it is its
    lifeline: it ends its workers and itself when this end is closed, be it by a signal, here, or
    because this process was killed.
    """
    with (
        subprocess.Popen(
            asked, env=environment, stdin=subprocess.PIPE, start_new_session=True
        ) as suite,
        _ended_by(signal.SIGTERM),
    ):
        try:
            return suite.wait()
        except KeyboardInterrupt:
            assert suite.stdin is not None
            suite.stdin.close()
            return suite.wait()


@contextlib.contextmanager
def _ended_by(number: signal.Signals) -> Iterator[None]:
    """A signal in here is an interrupt."""
    before = signal.signal(number, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(number, before)


def words_of(options: argparse.Namespace) -> list[str]:
    """The options as words again."""
    words = [f"--{name}" for name in ("quick", "final", "real") if getattr(options, name)]
    for name in ("seed", "only", "jobs", "keep", "json", "report"):
        value = getattr(options, name)
        if value not in (None, ""):
            words.append(f"--{name}={value}")
    return words
