"""Measure and print JSON: `python -m tests.rig.mixing_rig [EXPERIMENT...] [--quick]`."""

import argparse
import json
import tempfile
from pathlib import Path

from tests.rig.mixing_rig.cases import EXPERIMENTS, FULL, QUICK
from tests.rig.mixing_rig.judge import run
from tests.rig.mixing_rig.measure import FORMS


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.rig.mixing_rig", description=__doc__)
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help=", ".join(EXPERIMENTS))
    parser.add_argument("--quick", action="store_true", help="few recordings of each kind")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--json", choices=["-"], help="standard output, as without it")
    options = parser.parse_args()
    if strangers := set(options.experiments) - set(EXPERIMENTS):
        parser.error(f"no experiment {', '.join(sorted(strangers))}")
    scale, form = QUICK if options.quick else FULL, {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.experiments or EXPERIMENTS:
            form[name] = FORMS[name](run(Path(folder), EXPERIMENTS[name](scale), options.workers))
    print(json.dumps(form, indent=1))


if __name__ == "__main__":
    main()
