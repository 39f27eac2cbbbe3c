"""What an operator waits for before anything happens.

Processor time of a process, where the compiled plant is kept from an earlier start. The start ends
where the real work begins: the plant is read and checked, and so is the recording where there is
one. `calibrate`, `mismatch` and `experiment` build their models after that, for which they load
sympy. `study` and `adopt` build theirs before any recording: they are looked at until then. Others
do nothing else, and are measured to their end.
"""

import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from pathlib import Path

from tests.bench.conftest import Add
from tests.conftest import ROOT, SOURCES

GOAL = 0.4
"""Seconds of processor time of a second start, at most."""

GOAL_OF_MODELS = 1.5
"""The same of a command that builds models, for which it reads the plant's files again."""

BUILD = ("calibrate", "study", "mismatch", "experiment", "adopt")

ROUNDS = 5
"""The least of so many counts: others use the processor as well."""

ABC, ADOPTED = "plants/abc", "adopted"

CALLS = (
    f"show order {ABC}",
    f"matrix {ABC}",
    f"check {ABC} {ABC}/examples/healthy.csv",
    f"compile {ABC} -o {{}}/r.json",
    f"export {ABC} --to c -o {{}}/code",
    f"simulate {ABC} {ABC}/examples/leakage_A.csv -o {{}}/s.csv",
    f"diagnose {ABC} {ABC}/examples/leakage_A.csv",
    f"calibrate {ABC} {ABC}/examples/calibration.csv -o {{}}/c.yaml",
    f"study {ABC} --points 1 --seeds 1 --degrees 0.3 --jobs 1",
    f"mismatch {ABC} {ABC}/examples/warm_A.csv --json {{}}/m.json",
    "experiment {}/m.json",
    f"adopt {{}}/m.json -o {{}}/{ADOPTED}",
)
"""Commands; ``{}`` is a folder of their own. Those behind `mismatch` need its answer."""

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
    from rulec.commands.mismatch import Reread
    from rulec.passes.compile_cache import OpenedPlant
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
    """Seconds of processor time until the real work begins; there the process ends, if asked to.
    What is compiled, also by Python itself, is kept in the folder."""
    file = folder / "begun"
    file.unlink(missing_ok=True)
    shutil.rmtree(folder / ADOPTED, ignore_errors=True)
    own = {key: v for key, v in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    own |= {"PYTHONPATH": SOURCES, "RULEC_CACHE": str(folder / "cache")}
    own |= {"PYTHONPYCACHEPREFIX": str(folder / "bytecode"), "OPENBLAS_NUM_THREADS": "1"}
    own |= {"BENCH_ENDS": "1"} if ends else {}
    run = [sys.executable, "-c", _DRIVER, str(file), *words]
    subprocess.run(run, check=True, capture_output=True, cwd=ROOT, env=own)
    return float(json.loads(file.read_text()))


def wall_time(*arguments: str) -> float:
    """Median wall time of a process."""
    environment, times = {**os.environ, "PYTHONPATH": SOURCES}, []
    for _ in range(9):
        begin = time.perf_counter()
        call = [sys.executable, *arguments]
        subprocess.run(call, check=True, capture_output=True, env=environment)
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def test_help(add: Add) -> None:
    """`rulec VERB --help`; beside it Python alone."""
    add("start: python alone", wall_time("-c", "pass"), "s")
    for verb in ("diagnose", "compile"):
        add(f"start: rulec {verb} --help", wall_time("-m", "rulec", verb, "--help"), "s", 0.2)


def test_second_start_on_a_plant(tmp_path: Path, add: Add) -> None:
    for call in CALLS:
        words = call.replace("{}", str(tmp_path)).split()
        start_of(words, tmp_path, ends=False)  # the first start; an answer stands there then
        found = min(start_of(words, tmp_path) for _ in range(ROUNDS))
        goal = GOAL_OF_MODELS if words[0] in BUILD else GOAL
        add(f"start: rulec {call}", found, "s CPU", goal)
