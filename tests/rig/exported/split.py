"""Modules apart, central part apart: are the findings those of the whole?"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.from_modules import diagnose_results
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.diagnosis.steady.limits import IMPROBABLE
from rulec_runtime.recordings.module_results import read_results
from rulec_runtime.recordings.recording import read_recording

from rulec.export.module_code import code_of
from rulec.export.play_on_recording import Execute, played, results_csv
from rulec.export.program import run
from rulec.export.value_names import listed_undo
from tests.rig.exported.compiled import COMPILER, compiled


@dataclass(frozen=True)
class Split:
    """One recording judged as a whole and by way of its modules: with mean readings beside their
    results, and by slopes alone."""

    whole: Diagnosis
    given: Diagnosis
    first_order: Diagnosis


def split(ruleset: Ruleset, recording: Path, work: Path) -> Split:
    """Judge a recording in all ways; modules are compiled C where there is a compiler."""
    # Modules know listed faults alone.
    ruleset = replace(ruleset, unlisted=(), unlisted_cells=(), undo=listed_undo(ruleset))
    read = read_recording(recording, ruleset)
    codes = code_of(ruleset)
    execute: Execute = run if COMPILER is None else compiled(codes, work).run
    columns = played(read, ruleset, codes, execute)
    (work / "results.csv").write_text(results_csv(columns), encoding="utf-8")
    bare = {n: c for n, c in columns.items() if n.partition(" [")[0] not in ruleset.signal_by_id}
    (work / "bare.csv").write_text(results_csv(bare), encoding="utf-8")
    results = read_results(work / "results.csv", ruleset)
    return Split(
        diagnose(read, ruleset),
        diagnose_results(results, ruleset),
        diagnose_results(read_results(work / "bare.csv", ruleset), ruleset),
    )


def same_story(a: Diagnosis, b: Diagnosis) -> bool:
    """The same faults at the same times with the same rivals; the same that nothing explains,
    and the same regimes."""
    return _story(a) == _story(b)


def _story(diagnosis: Diagnosis) -> tuple[object, ...]:
    found = [
        (*_key(f), round(f.until, 6), sorted(name for name, _ in f.alternatives))
        for f in sorted(diagnosis.findings, key=_key)
    ]
    unknown = [(round(p.since, 6), round(p.until, 6), p.text) for p in diagnosis.unknown]
    regimes = [(r.regime.id, round(r.since, 6), round(r.until, 6)) for r in diagnosis.regimes]
    return found, unknown, regimes


def gaps(a: Diagnosis, b: Diagnosis) -> Iterator[float]:
    """By how much degrees, their bounds and residuals of findings differ, as shares of what they
    are where they are above 1; one finding after the other. Probabilities differ only by faults
    that are too improbable to be tried, which rounding may decide."""
    pairs = zip(sorted(a.findings, key=_key), sorted(b.findings, key=_key), strict=False)
    for one, other in pairs:
        assert abs(one.probability - other.probability) < IMPROBABLE
        yield from (
            abs(x - y) / max(abs(x), 1.0) for x, y in zip(*map(_told, (one, other)), strict=True)
        )


def _told(f: Finding) -> tuple[float, ...]:
    residuals = (e.value / e.threshold for e in f.evidence if e.threshold)
    return (f.degree, f.lower, f.upper, *residuals)


def _key(finding: Finding) -> tuple[str, float]:
    return finding.fault.id, round(finding.since, 6)
