"""Is a wrong connection of a settled plant found, and none told where there is none?

Sealed development cases, judged by the hypotheses of structure alone:
``python -m tests.rig.mismatch.connections [SEED]``.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.structure import limits
from rulec.mismatch.structure.hypotheses import CONNECTION, AcceptedHypothesis
from rulec.mismatch.structure.settled import Settled
from rulec.mismatch.structure.structure_search import structure_of
from rulec.prove.analyst import calibrate
from rulec.prove.truth.settled.plan import SettledCase
from rulec.prove.truth.settled.suite import planned

SEED = 101
GROUPS = {"connection": 24, "clean": 24, "single": 24, "fault": 18, "sensor": 12, "pair": 8}


def cases(seed: int) -> Iterator[SettledCase]:
    """All that can be made."""
    for plan in planned(seed, GROUPS):
        try:
            yield plan.make()
        except ValueError:
            print(f"{plan.name}: not made")


def taken(case: SettledCase) -> tuple[tuple[AcceptedHypothesis, ...], float, float]:
    """What is told of a case, how far the plain model is strained, nats, and CPU s."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        case.write(folder)
        calibrate(folder)
        ruleset, builder = open_builder(folder / "plant")
        recording = read_recording(folder / "recording.csv", ruleset)
        evidence = Settled(ruleset, builder, ())
        begin = time.process_time()
        found = structure_of(recording, evidence, lambda text: None).taken
        seconds = time.process_time() - begin
        return found, evidence.agreement(recording, limits.STRUCTURE_STEPS).strain, seconds


def main(seed: int) -> None:
    """One line a case, then counts by group."""
    counts: dict[str, list[int]] = {}
    for case in cases(seed):
        found, strain, seconds = taken(case)
        pipes = [t for t in found if t.hypothesis.kind == CONNECTION]
        places = {p for planted in case.answer.effects for p in planted.places}
        right = [t for t in pipes if set(t.hypothesis.places) & places]
        own = counts.setdefault(case.plan.group, [0, 0, 0, 0])
        told = (True, bool(right), len(right) < len(pipes), len(pipes) < len(found))
        counts[case.plan.group] = [count + more for count, more in zip(own, told, strict=True)]
        said = "; ".join(t.hypothesis.text for t in found)
        print(f"{case.plan.name}: strain {strain:.0f}, {seconds:.2f} s: {said}", flush=True)
    for group, (every, right_, wrong, columns) in counts.items():
        print(f"{group}: {every} cases, pipe right {right_}, pipe wrong {wrong}, columns {columns}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SEED)
