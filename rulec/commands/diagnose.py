"""`rulec diagnose`: which fault, how large, and why."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from rulec_runtime.commands.destinations import progress_of
from rulec_runtime.commands.diagnose import show_results
from rulec_runtime.diagnosis.diagnose import Diagnosis
from rulec_runtime.diagnosis.from_modules import FIRST_ORDER
from rulec_runtime.diagnosis.hidden_faults import Blind
from rulec_runtime.diagnosis.steady.findings import Finding
from rulec_runtime.report.judged import Judged, judged

from rulec.commands.arguments import (
    Plant,
    Recorded,
    is_path,
    names_given,
    recording_given,
    ruleset_of,
)
from rulec.commands.result import AnyPath, Columns, PageResult


@dataclass(frozen=True, kw_only=True)
class DiagnoseResult(Judged, PageResult):
    """The diagnosis of a recording; `diagnosis` is the whole of it, SI.

    Tables: `findings` (a row each; times in s), and `samples` (a row per sample: verdict, and the
    degree of each fault with its bounds).
    """

    def __repr__(self) -> str:
        faults = ", ".join(f.fault.id for f in self.findings) or "no fault"
        return f"<DiagnoseResult {self.name}: {self.status}, {faults}>"

    @property
    def status(self) -> str:
        """Letter of NE 107: F, C, S, M, or ok."""
        return self.diagnosis.status

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Faults, in order of time."""
        return self.diagnosis.findings

    @property
    def blind(self) -> tuple[Blind, ...]:
        """Faults that could not be detected because readings are missing."""
        return self.diagnosis.blind

    def _findings(self) -> Columns:
        rows = self.to_dict()["findings"]
        names = ("kind", "fault", "module", "status", "degree", "lower", "upper", "probability")
        more = ("since", "until", "active", "text", "action")
        return {name: [row[name] for row in rows] for name in (*names, *more)}

    def _samples(self) -> Columns:
        trace = self.trace
        columns: dict[str, Any] = {"time [s]": trace.time, "verdict": list(trace.verdict)}
        for j, name in enumerate(trace.faults):
            columns[name] = trace.degree[j]
            columns[f"{name} lower"] = trace.lower[j]
            columns[f"{name} upper"] = trace.upper[j]
        return columns

    _tables: ClassVar = {"findings": _findings, "samples": _samples}


def diagnose(
    plant: Plant,
    recording: Recorded,
    *,
    mode: Literal["default", "paper"] = "default",
    limits: AnyPath | None = None,
    truth: AnyPath | None = None,
) -> DiagnoseResult:
    """Judge a recording: which fault, how large, how sure, and why.

    Parameters
    ----------
    plant : folder, plant.yaml, ruleset file, or what `rulec.compile` returned.
    recording : path, data frame or mapping of arrays of shape (n,); units as in the titles. A path
        may hold results of modules instead.
    mode : ``default`` compares whole signatures with their uncertainties, ``paper`` applies
        Eqs. 17-19 of the seed paper as printed.
    limits : file that says how far set points may be changed to tell faults apart.
    truth : file with true degrees, for comparison on the page.

    Raises
    ------
    Refused, RulesetRefused
        The plant, its ruleset or the limits have mistakes.
    RecordingRefused
        This is no recording of the plant.

    Examples
    --------
    >>> import rulec
    >>> found = rulec.diagnose("plants/abc", "plants/abc/examples/leakage_A.csv")
    >>> [(f.fault.id, round(f.degree, 1)) for f in found.findings]
    [('A.leakage', 0.2), ('A.leakage', 0.4), ('A.leakage', 0.6)]
    """
    ruleset = ruleset_of(plant)
    (name,) = names_given([recording])
    read = None if is_path(recording) else recording_given([recording], ruleset)
    found = judged(name, ruleset, mode, None if truth is None else Path(truth), read)
    diagnosis = found.diagnosis
    if FIRST_ORDER not in diagnosis.notes:
        diagnosis = with_steps(diagnosis, None if limits is None else Path(limits))
    return DiagnoseResult(**{**vars(found), "diagnosis": diagnosis})


def with_steps(diagnosis: Diagnosis, limits: Path | None) -> Diagnosis:
    """Add a step to each ambiguous finding; the code that proposes steps is loaded only then."""
    if limits is None and not any(f.alternatives for f in diagnosis.findings):
        return diagnosis
    from rulec.separation.allowed import allowed_of
    from rulec.separation.steps import add_steps

    given = None
    if limits is not None:
        from rulec.separation.limits_file import read_limits

        given = read_limits(limits, diagnosis.ruleset)
    return add_steps(diagnosis, allowed_of(diagnosis.ruleset, given))


def run(options: argparse.Namespace) -> int:
    """Diagnose a recording; the exit code is that of `rulec-runtime diagnose`."""
    with progress_of(options, "reading and judging the recording") as progress:
        found = diagnose(
            options.plant,
            options.recording,
            mode=options.mode,
            limits=options.limits,
            truth=options.truth,
        )
        return show_results(options, found, progress)
