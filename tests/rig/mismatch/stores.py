"""Plants that store, by the independent truth of tanks: clean recordings, and planted effects."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.analyse import analyse
from rulec.prove.truth.tanks import CASCADED, named
from tests.conftest import ROOT


def verdicts(
    work: Path, clean: int, groups: tuple[str, ...] = ("clean",)
) -> Iterator[tuple[str, str, str]]:
    """What was planted, the verdict, and what was found with the held-out error in volts.

    Analysed in this process: the answers stay in memory and are not given to the analysis.
    """
    ruleset, builder = open_builder(ROOT / "plants" / CASCADED.name)
    for case in named(1, clean={CASCADED.name: clean}, groups=groups):
        if case.layout.name != CASCADED.name:
            continue
        case.make(1024).write(work, "case")
        found = analyse(read_recording(work / "case.csv", ruleset), ruleset, builder)
        planted = " + ".join(case.effects) or f"nothing, {case.number}"
        told = ", ".join(finding.id for finding in found.findings)
        if found.fit is not None:
            errors = found.fit.heldout
            told += f" ({errors.recalibrated:.3f} -> {errors.repaired:.3f}, {errors.noise:.3f})"
        yield planted, found.verdict, told
