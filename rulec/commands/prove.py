"""`rulec prove`: the suite of concealed effects, which lives with the independent truth in `tests`.

The truth that makes the cases shares no code with this package, so it is started as a process.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from pathlib import Path

from rich.console import Console

SOURCE = Path(__file__).parents[2]
SUITE = "tests.prove"


def run(options: argparse.Namespace) -> int:
    """Start the suite with the same options."""
    if not (SOURCE / "tests" / "prove" / "__main__.py").exists():
        aside = Console(stderr=True, highlight=False)
        aside.print(
            "rulec prove: the suite is part of the project's source tree, not of the installed "
            "package; clone the project and run it there",
            soft_wrap=True,
        )
        return 1
    path = os.pathsep.join(filter(None, [str(SOURCE), os.environ.get("PYTHONPATH")]))
    asked = [sys.executable, "-m", SUITE, *words_of(options)]
    try:
        return subprocess.run(asked, env={**os.environ, "PYTHONPATH": path}, check=False).returncode
    except KeyboardInterrupt:
        return 130


def words_of(options: argparse.Namespace) -> list[str]:
    """The options as words again."""
    words = [f"--{name}" for name in ("quick", "final") if getattr(options, name)]
    for name in ("seed", "only", "jobs", "keep", "json", "report"):
        value = getattr(options, name)
        if value not in (None, ""):
            words.append(f"--{name}={value}")
    return words
