"""Names by evidence, on sealed cases: `python -m tests.rig.experiment --seed 2 --only single`."""

from __future__ import annotations

import argparse
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from rich.console import Console
from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.steady.configuration import Configuration
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import rows_of
from rulec.mismatch.evidence.steady.system import System
from rulec.prove import analyst
from rulec.prove.truth.sealed import Answer, Planted
from rulec.prove.truth.settled import suite
from tests.conftest import recordings_folder
from tests.rig.experiment.sets import Posterior, explain
from tests.rig.mismatch import adopted

COUNTS = {"clean": 8, "single": 8, "calibrated": 2, "correlated": 2, "sensor": 4, "fault": 4}
COUNTS |= {"pair": 3, "hiding": 2}

HARD = {"form-clean": 8, "coloured-clean": 6, "drift-clean": 6, "all-clean": 4, "form": 8}
"""Cases whose laws, noise or sensors are harder than the plant's own description."""

SETTLED = ("pipeline", "pump-loop", "zema", "esp")
"""Real rigs that are run at settled points."""

NAMED, OPEN = 0.9, 0.3
"""Probability from which on an explanation is named, and from which on it is left open."""


def main() -> None:
    """Draw cases, ask, and print what was right."""
    parser = argparse.ArgumentParser(prog="python -m tests.rig.experiment", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the cases (default 1)")
    parser.add_argument("--only", default="", help="cases whose name holds this word")
    parser.add_argument("--rigs", action="store_true", help="ask about real recordings instead")
    parser.add_argument("--hard", action="store_true", help="cases with errors of form and drift")
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    options = parser.parse_args()
    out, counts = Console(width=160), Counter[str]()
    if options.rigs:
        for line in _rigs(options.only):
            out.print(line, markup=False)
        return
    cases = [
        c
        for c in suite.planned(options.seed, HARD if options.hard else COUNTS, True)
        if options.only in c.name
    ]
    with ProcessPoolExecutor(options.jobs) as pool:
        for line, found in pool.map(_asked, cases):
            out.print(line, markup=False)
            counts.update(found)
    for what, count in counts.items():
        out.print(f"{what}: {count:g}")


def _asked(case: suite.Planned) -> tuple[str, Counter[str]]:
    """One case: a line, and what it counts."""
    try:
        made = case.make()
    except ValueError:
        return f"{case.name}: no plant shows it", Counter()
    begin = time.process_time()
    with tempfile.TemporaryDirectory() as name:
        made.write(Path(name))
        analyst.calibrate(Path(name))
        posterior = answer(Path(name) / "plant", Path(name) / "recording.csv")
    seconds = time.process_time() - begin
    if posterior is None:
        return f"{case.name}: nothing to compare", Counter()
    counts = Counter(dict(_judged(made.answer, posterior)))
    wrong = [n for n, p in posterior.names.items() if p >= NAMED and not _of_truth(n, made.answer)]
    told = f"; wrong: {', '.join(wrong)}" if wrong else ""
    planted = " + ".join(f"{p.module}.{p.effect}" for p in made.answer.effects) or "nothing"
    return f"{planted}: {_text(posterior)}; {seconds:.0f} s{told}", counts


def _text(posterior: Posterior) -> str:
    """The most probable explanations."""
    told = sorted(posterior.names.items(), key=lambda n: -n[1])[:4]
    names = [f"{name} {p:.2f}" for name, p in told if p > 0.02]
    return ", ".join([*names, f"nothing {posterior.nothing:.2f}"])


def _rigs(only: str) -> Iterator[str]:
    """A line for each real recording of settled points."""
    with tempfile.TemporaryDirectory() as name:
        for rig in (rig for rig in SETTLED if only in rig):
            for case in adopted.RIGS[rig](recordings_folder(), Path(name)):
                begin = time.process_time()
                found = answer(Path(case.plant), Path(case.analysis))
                text = "nothing to compare" if found is None else _text(found)
                yield f"{case.name}: {text}; {time.process_time() - begin:.0f} s"


def answer(plant: Path, file: Path) -> Posterior | None:
    """What a recording says of a plant; None where nothing can be compared."""
    ruleset, builder = open_builder(plant)
    data = prepare(read_recording(file, ruleset), ruleset)
    if data is None:
        return None
    rows = rows_of(System(ruleset, builder, data), Configuration())
    return explain(rows, lambda text: None) if len(rows) else None


def _judged(answer: Answer, posterior: Posterior) -> Iterator[tuple[str, int]]:
    """Places, names, false names and clean recordings of one case."""
    if not answer.effects:
        yield "clean", 1
        yield "clean called clean", int(posterior.nothing > 0.5)
    named = {name for name, p in posterior.names.items() if p >= NAMED}
    right = {n: [p for p in answer.effects if _is_right(n, p)] for n in posterior.names}
    yield "false names", sum(not right[name] for name in named if "~" not in name)
    yield "places told without a name", sum("~" in name for name in named)
    if not answer.effects:
        return
    best = [
        max((posterior.names[n] for n in right if p in right[n]), default=0.0)
        for p in answer.effects
    ]
    yield "planted", len(best)
    yield "named", sum(p >= NAMED for p in best)
    yield "left open", sum(OPEN <= p < NAMED for p in best)


def _of_truth(name: str, answer: Answer) -> bool:
    return any(_is_right(name, planted) for planted in answer.effects)


def _is_right(name: str, planted: Planted) -> bool:
    """Is an explanation the one that was planted, under any of its names?"""
    module, _, rest = name.rstrip("!").partition(".")
    if planted.module not in module.split("+"):
        return False
    effect, _, place = rest.partition("@")
    fault = not place and planted.sort == "fault"
    return effect in planted.names or fault


if __name__ == "__main__":
    main()
