"""Ours beside peers: `python -m tests.bench`, `make bench`.

Every peer runs in a process of its own, after ours in the same process: ratios of medians of CPU
time, warm, on one core. `--only` takes some of them; `--json FILE` writes all.
"""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from tests.bench import peers

PARTS = tuple(m.name for m in pkgutil.iter_modules(peers.__path__))


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench", description=__doc__)
    parser.add_argument("--only", nargs="*", choices=PARTS, default=PARTS)
    parser.add_argument("--json", metavar="FILE", help="- for standard output")
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
    form = {one["key"]: one for one in found}
    shown = aside if options.json == "-" else Console()
    shown.print(beside(found))
    shown.print("\nCPU time. What is the same in both, and what is not: docs/compare.md")
    if options.json == "-":
        print(json.dumps(form, indent=1))
    elif options.json:
        Path(options.json).write_text(json.dumps(form, indent=1) + "\n", encoding="utf-8")
    return 0 if found else 1


def part_of(name: str) -> Iterator[dict[str, Any]]:
    """Rows of a peer."""
    for row in importlib.import_module(f"{peers.__name__}.{name}").rows():
        yield asdict(row) | {"ratio": row.ratio}


def beside(found: list[dict[str, Any]]) -> Table:
    """Ours beside peers. What is the same in both is told on the page."""
    table = Table(box=None, pad_edge=False, padding=(0, 1))
    for place, title in enumerate(("what", "peer", "ours", "peer's", "ratio")):
        table.add_column(title, justify="left" if place < 2 else "right", no_wrap=place >= 2)
    for one in found:
        words = (seconds(one["ours"]), seconds(one["theirs"]), f"{one['ratio']:.3g}")
        table.add_row(one["what"], one["peer"], *words)
    return table


def seconds(value: float) -> str:
    """CPU time in a unit that suits."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e-9:.3g} ns"


if __name__ == "__main__":
    raise SystemExit(main())
