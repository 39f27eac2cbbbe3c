"""How a plant is followed: `python -m tests.rig.follower [PART...] [--json FILE]`.

``agreement``: recordings on which the watch tells in the end what the diagnosis of the whole tells;
``replay``: signal values per second; ``latency``: from sample to event, with 200 readings at ten
rows a second; ``memory``: a replayed week.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.conftest import ROOT, compiled
from tests.rig.follower import agreement, speed
from tests.rig.follower.plants import Planted, recorded

HOUR = 3600


def memory() -> dict[str, Any]:
    """A week at a row a second of plant `abc`, with a leakage for half of each hour."""
    ruleset = compiled("abc")
    planted = [Planted("A.leakage", 0.3, HOUR // 2, HOUR)]
    hour = recorded(ruleset, HOUR, planted, 1.0, np.random.default_rng(3))
    with tempfile.TemporaryDirectory(prefix="rulec-follower-") as folder:
        rules, readings = Path(folder, "abc.json"), Path(folder, "hour.npz")
        rules.write_text(ruleset.to_json(), encoding="utf-8")
        np.savez(readings, **hour.values)
        command = [sys.executable, "-m", "tests.rig.follower.week", str(rules), str(readings)]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


PARTS: dict[str, Callable[[], dict[str, Any]]] = {
    "agreement": agreement.measure,
    "replay": speed.replay,
    "latency": speed.latency,
    "memory": memory,
}


def main() -> int:
    """Measure one part after the other."""
    parser = argparse.ArgumentParser(prog="python -m tests.rig.follower", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--json", metavar="FILE", help="machine form; - for standard output")
    options = parser.parse_args()
    if strangers := set(options.parts) - set(PARTS):
        parser.error(f"no part {', '.join(sorted(strangers))}")
    form = {}
    for name in options.parts or PARTS:
        form[name] = PARTS[name]()
        print(f"{name}: {json.dumps(form[name], indent=1)}", file=sys.stderr)
    if options.json == "-":
        print(json.dumps(form, indent=1))
    elif options.json:
        Path(options.json).write_text(json.dumps(form, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
