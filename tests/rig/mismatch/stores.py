"""Plants that store, by the independent truth of tanks: clean recordings, and planted effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.analyse import analyse
from rulec.prove.truth.tanks import CASCADED
from rulec.prove.truth.tanks.suite import cases
from tests.conftest import ROOT

SEED = 1
"""Of the plants, and of what is planted."""


def verdicts(work: Path, count: Mapping[str, int]) -> Iterator[tuple[str, str, str]]:
    """What was planted, the verdict, and what was found with the held-out error in volts.

    So many cases of each group, all of the shipped plant; one that no plant shows is left out.

    Analysed in this process: the answers stay in memory and are not given to the analysis.
    """
    ruleset, builder = open_builder(ROOT / "plants" / CASCADED.name)
    for case in cases(SEED, count, own=1.0):
        folder = work / case.name
        try:
            case.make().write(folder)
        except ValueError:
            continue
        found = analyse(read_recording(folder / "recording.csv", ruleset), ruleset, builder)
        planted = " + ".join(case.effects) or f"nothing, {case.number}"
        told = ", ".join(finding.id for finding in found.findings)
        if found.fit is not None:
            errors = found.fit.heldout
            told += f" ({errors.recalibrated:.3f} -> {errors.repaired:.3f}, {errors.noise:.3f})"
        yield planted, found.verdict, told
