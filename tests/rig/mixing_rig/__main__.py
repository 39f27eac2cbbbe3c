"""Print all figures: `python -m tests.rig.mixing_rig [EXPERIMENT...] [--quick] [--json FILE]`."""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from tests.rig.mixing_rig.cases import EXPERIMENTS, FULL, QUICK
from tests.rig.mixing_rig.form import FORMS
from tests.rig.mixing_rig.goals import GOALS, Goal
from tests.rig.mixing_rig.run import run
from tests.rig.mixing_rig.show import SHOW, show_goals


def main() -> None:
    """Run the experiments one after the other."""
    parser = argparse.ArgumentParser(prog="python -m tests.rig.mixing_rig", description=__doc__)
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help=", ".join(EXPERIMENTS))
    parser.add_argument("--quick", action="store_true", help="few recordings of each kind")
    parser.add_argument("--workers", type=int, default=2, help="processes (default 2)")
    parser.add_argument("--json", metavar="FILE", help="machine form; - for standard output")
    options = parser.parse_args()
    if strangers := set(options.experiments) - set(EXPERIMENTS):
        parser.error(f"no experiment {', '.join(sorted(strangers))}")
    out = Console(width=150, highlight=False, stderr=options.json == "-")
    scale = QUICK if options.quick else FULL
    goals: list[Goal] = []
    form = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.experiments or EXPERIMENTS:
            tasks, begin = EXPERIMENTS[name](scale), time.perf_counter()
            with Progress(console=Console(stderr=True), transient=True) as progress:
                judged = run(Path(folder), tasks, options.workers, progress)
            seconds = time.perf_counter() - begin
            out.print(f"[bold]{name}[/]: {len(tasks)} recordings, {seconds:.0f} s\n")
            SHOW[name](out, judged)
            form[name] = FORMS[name](judged)
            goals += GOALS[name](judged) if name in GOALS else []
    show_goals(out, goals)
    if options.json == "-":
        print(json.dumps(form, indent=1))
    elif options.json:
        Path(options.json).write_text(json.dumps(form, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
