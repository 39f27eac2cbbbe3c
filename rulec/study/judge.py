"""Judge one simulated recording: the diagnosis of a known fault."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.recordings.recording import Recording


class Kind(StrEnum):
    """The kind of outcome of a recording."""

    NO_POINT = "no operating point"
    NOT_JUDGED = "not judged"
    QUIET = "nothing said"
    UNKNOWN = "nothing known fits"
    NAMED = "named first"
    OTHER = "another named first"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of one recording.

    `fault` is empty in a healthy one. `first` is the fault named first, `shared` whether the true
    one is among the alternatives; `estimate`, `lower`, `upper` are the degree of the finding;
    `early` is a false alarm before the onset of the fault.
    """

    fault: str
    degree: float
    kind: Kind
    first: str = ""
    shared: bool = False
    estimate: float = 0.0
    lower: float = 0.0
    upper: float = 0.0
    early: bool = False


def judge(
    ruleset: Ruleset,
    readings: Mapping[str, Array],
    fault: str,
    degree: float,
    onset: int,
    mode: str,
) -> Outcome:
    """Diagnose a recording of one sample a second with a fault from sample `onset` on."""
    samples = len(next(iter(readings.values())))
    time, segment = np.arange(float(samples)), np.zeros(samples, dtype=int)
    diagnosis = diagnose(
        Recording(time=time, values=readings, segment=segment, missing=(), notes=()), ruleset, mode
    )
    ends = [f.until for f in diagnosis.findings] + [p.until for p in diagnosis.unknown]
    early = any(end < onset for end in ends)
    late = [f for f in diagnosis.findings if f.until >= onset]
    # The finding that covers most of the time from the onset on.
    finding = max(late, key=lambda f: f.until - max(f.since, onset), default=None)
    if finding is None:
        unknown = any(p.until >= onset for p in diagnosis.unknown)
        kind = Kind.UNKNOWN if unknown else Kind.QUIET if diagnosis.judged else Kind.NOT_JUDGED
        return Outcome(fault=fault, degree=share(ruleset, fault, degree), kind=kind, early=early)
    return Outcome(
        fault=fault,
        degree=share(ruleset, fault, degree),
        kind=Kind.NAMED if finding.fault.id == fault else Kind.OTHER,
        first=finding.fault.id,
        shared=any(name == fault for name, _ in finding.alternatives),
        estimate=finding.degree / finding.fault.scale,
        lower=finding.lower / finding.fault.scale,
        upper=finding.upper / finding.fault.scale,
        early=early,
    )


def share(ruleset: Ruleset, fault: str, degree: float) -> float:
    """A degree as a share, of what it acts on or of the range of its sensor; 0 without a fault."""
    return degree / ruleset.fault_by_id[fault].scale if fault else 0.0
