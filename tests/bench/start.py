"""What a command costs before its real work begins: `python -m tests.bench.start`.

Processor time of a process, where the compiled plant and its documents are kept from an earlier
start. The start ends where the real work begins: the plant is read and checked, and so is the
recording where there is one. `calibrate`, `mismatch` and `experiment` build their models after
that, for which they load sympy. `study` and `adopt` build theirs before any recording: they are
looked at until then. Others do nothing else, and are measured to their end.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

from tests.conftest import ROOT, SOURCES

GOAL = 0.4
"""Seconds of processor time of a second start, at most."""

ROUNDS = 5
"""The least of so many counts: others use the processor as well."""

ABC, RIG, ADOPTED = "plants/abc", "plants/mixing-rig", "adopted"

CALLS: Mapping[str, str] = {
    "show": f"show order {ABC}",
    "matrix": f"matrix {ABC}",
    "matrix-rig": f"matrix {RIG}",
    "check": f"check {ABC}",
    "check-recording": f"check {ABC} {ABC}/examples/healthy.csv",
    "compile": f"compile {ABC} -o {{}}/r.json",
    "export": f"export {ABC} --to c -o {{}}/code",
    "simulate": f"simulate {ABC} {ABC}/examples/leakage_A.csv -o {{}}/s.csv",
    "simulate-rig": f"simulate {RIG} {RIG}/examples/clogging_D.csv -o {{}}/s.csv",
    "diagnose": f"diagnose {ABC} {ABC}/examples/leakage_A.csv",
    "diagnose-rig": f"diagnose {RIG} {RIG}/examples/clogging_D.csv",
    "calibrate": f"calibrate {ABC} {ABC}/examples/calibration.csv -o {{}}/c.yaml",
    "study": f"study {ABC} --points 1 --seeds 1 --degrees 0.3 --jobs 1",
    "mismatch": f"mismatch {ABC} {ABC}/examples/warm_A.csv --json {{}}/m.json",
    "experiment": "experiment {}/m.json",
    "adopt": f"adopt {{}}/m.json -o {{}}/{ADOPTED}",
}
"""Commands by what they are called; ``{}`` is a folder of their own. Those behind `mismatch` need
its answer."""

_DRIVER = """
import json, os, sys, time
arguments, file = sys.argv[2:], sys.argv[1]

def begun(code=0):
    if not os.path.exists(file):
        with open(file, "w") as out:
            json.dump(time.process_time(), out)
        if os.environ.get("BENCH_ENDS"):
            os._exit(code)

if arguments[0] in ("study", "adopt"):
    from rulec.api.reread import Reread
    from rulec.passes.deferred_compilation import OpenedPlant
    part = OpenedPlant.models if arguments[0] == "study" else Reread.builder
    build = part.func
    def models(self):
        begun()
        return build(self)
    part.func = models
elif arguments[0] not in ("show", "matrix", "compile", "export"):
    from rulec_runtime.recordings.recording_file import RecordingFile
    made = RecordingFile.__init__
    def init(self, *parts, **named):
        made(self, *parts, **named)
        begun()
    RecordingFile.__init__ = init

from rulec.cli import main
code = main(arguments)
begun(code)
raise SystemExit(code)
"""


def start_of(words: list[str], folder: Path, ends: bool = True) -> float:
    """Seconds of processor time until the real work begins; there the process ends, if asked to."""
    file = folder / "begun"
    file.unlink(missing_ok=True)
    shutil.rmtree(folder / ADOPTED, ignore_errors=True)
    run = [sys.executable, "-c", _DRIVER, str(file), *words]
    subprocess.run(run, check=True, capture_output=True, cwd=ROOT, env=_environment(folder, ends))
    return float(json.loads(file.read_text()))


def _environment(folder: Path, ends: bool = False) -> dict[str, str]:
    """What is compiled, also by Python itself, is kept in the folder."""
    own = {key: v for key, v in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    own |= {"PYTHONPATH": SOURCES, "RULEC_CACHE": str(folder / "cache")}
    own |= {"PYTHONPYCACHEPREFIX": str(folder / "bytecode"), "OPENBLAS_NUM_THREADS": "1"}
    return own | ({"BENCH_ENDS": "1"} if ends else {})


def measured(folder: Path) -> dict[str, float]:
    """Seconds of processor time of a second start, by command."""
    found = {}
    for name, call in CALLS.items():
        words = call.replace("{}", str(folder)).split()
        start_of(words, folder, ends=False)  # the first start; an answer stands there then
        found[name] = min(start_of(words, folder) for _ in range(ROUNDS))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.bench.start", description=__doc__)
    parser.add_argument("--json", metavar="FILE", help="- for standard output")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="rulec-start-") as folder:
        found = measured(Path(folder))
    told = sys.stderr if options.json == "-" else sys.stdout
    for name, seconds in found.items():
        verdict = "met" if seconds <= GOAL else "missed"
        print(f"{name:<24}{seconds:6.2f} s   goal {GOAL:g}: {verdict}", file=told)
    if options.json == "-":
        print(json.dumps(found, indent=1))
    elif options.json:
        Path(options.json).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
