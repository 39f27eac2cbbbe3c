"""Ours beside peers: `python -m tests.bench`, `make bench`.

Every peer runs in a process of its own, after ours in the same process: ratios of medians of CPU
time, warm, on one core. `--only` takes some of them; `--json -` prints all.
"""

import argparse
import importlib
import json
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

from rich.console import Console

from tests.bench import peers

PARTS = tuple(m.name for m in pkgutil.iter_modules(peers.__path__))


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--only", nargs="*", choices=PARTS, default=PARTS)
    parser.add_argument("--json", choices=["-"], help="on standard output")
    parser.add_argument("--part", choices=PARTS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.part:
        print(json.dumps(list(part_of(options.part))))
        return 0
    aside, found = Console(stderr=True), []
    for part in options.only:
        aside.print(f"{part} ...", style="dim")
        call = [sys.executable, "-m", "tests.bench", "--part", part]
        done = subprocess.run(call, stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode:
            aside.print(f"{part}: nothing measured; peers come with pip install 'rulec[dev,bench]'")
            continue
        found += json.loads(done.stdout.splitlines()[-1])
    for one in found:
        aside.print(f"{one['what']:<58}{one['peer']:<44}{one['ratio']:.3g}", highlight=False)
    aside.print("Ratios of CPU time. What is the same in both, and what is not: docs/compare.md")
    if options.json:
        print(json.dumps({one["key"]: one for one in found}, indent=1))
    return 0 if found else 1


def part_of(name: str) -> Iterator[dict[str, Any]]:
    """Rows of a peer."""
    for row in importlib.import_module(f"{peers.__name__}.{name}").rows():
        yield asdict(row) | {"ratio": row.ratio}


if __name__ == "__main__":
    raise SystemExit(main())
