"""Faults that `rulec watch` survives: `python -m tests.soak [PART...] [--times N] --json -`.

Each part says how often something was done to the watch or to its source, how often it went on
(`went_on`), and how much was lost (`all_lost`) or told twice (`all_twice`) in the end: events by
their numbers, rows of a file, faults that were planted. `all_bad` counts tracebacks, and what would
steer a terminal. The disk needs root.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from tests.soak import disk, killed, mutated, score, sources

PARTS: dict[str, tuple[Callable[[Path, int], dict[str, Any]], int]] = {
    "kill-journal": (killed.journal_killed, 20),
    "kill-lines": (killed.lines_killed, 20),
    "opcua": (partial(sources.killed, "opcua"), 20),
    "mqtt": (partial(sources.killed, "mqtt"), 20),
    "disk-journal": (disk.full, 5),
    "mutated-file": (mutated.growing_file, 10_000),
}
"""Each with what it does, and how often."""


def main() -> int:
    """Run the parts one after the other; the machine form on standard output."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--times", type=int, metavar="N", help="default 20 of most parts")
    parser.add_argument("--keep", metavar="DIR", help="leave all files there")
    parser.add_argument("--json", metavar="FILE", help="machine form; - for standard output")
    options = parser.parse_args()
    if strangers := set(options.parts) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(strangers))}")
    form: dict[str, Any] = {}
    with tempfile.TemporaryDirectory(prefix="rulec-soak-") as folder:
        for name in options.parts or PARTS:
            part, usual = PARTS[name]
            place = Path(options.keep or folder) / name
            place.mkdir(parents=True, exist_ok=True)
            begin = time.perf_counter()
            form[name] = score.summed(part(place, options.times or usual))
            seconds = time.perf_counter() - begin
            print(f"{name}: {json.dumps(form[name])} ({seconds:.0f} s)", file=sys.stderr)
    text = json.dumps(form, indent=1)
    if options.json == "-":
        print(text)
    elif options.json:
        Path(options.json).write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
