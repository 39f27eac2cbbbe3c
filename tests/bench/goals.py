"""Speed against goals as JSON, for the pages that print it: `python -m tests.bench.goals --json -`.

`make goals` shows all of it. Here only the benchmarks run that have a figure on a page.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.conftest import ROOT, SOURCES

FILE = "RULEC_GOALS"
"""Variable of the environment: the file that gets what was found."""

PRINTED = "growth or alone"
"""Which benchmarks, in the words of pytest."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.goals", description=__doc__)
    parser.add_argument("--json", choices=["-"], help="standard output, as without it")
    parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "goals.json")
        call = [sys.executable, "-m", "pytest", "tests/bench", "-q", "-k", PRINTED]
        environment = {**os.environ, "PYTHONPATH": SOURCES, FILE: str(file)}
        done = subprocess.run(call, cwd=ROOT, env=environment, stdout=sys.stderr, check=False)
        if done.returncode:
            return done.returncode
        text = file.read_text(encoding="utf-8")
    print(text, end="")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
