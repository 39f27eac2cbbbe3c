"""What slopes by the degrees lose against equations: simulated faults of plant `abc`, judged as a
whole and by results of modules that hold no readings."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis

from tests.conftest import ROOT
from tests.rig.called import called
from tests.rig.exported.split import split

DEGREES = (0.1, 0.6)
PLANT = ROOT / "plants" / "abc"
INPUTS = PLANT / "examples" / "healthy.csv"
SINCE = 30.0
SEED = 7


@dataclass(frozen=True)
class Judged:
    """A simulated fault: is it the one that is named, and by how much is its degree off?"""

    degree: float
    right: bool
    error: float


def judged(ruleset: Ruleset, work: Path) -> Iterator[tuple[Judged, Judged]]:
    """Every fault at every degree: by the whole, and to first order."""
    for fault in ruleset.faults:
        for degree in DEGREES:
            folder = work / re.sub(r"\W", "_", f"{fault.id} {degree}")
            folder.mkdir()
            file = folder / "recording.csv"
            acts = f"{fault.id}={degree}@{SINCE:g}:1000"
            called("simulate", PLANT, INPUTS, "-o", file, "--fault", acts, "--noise", SEED)
            found = split(ruleset, file, folder)
            yield (
                _verdict(found.whole, fault.id, degree),
                _verdict(found.first_order, fault.id, degree),
            )


def _verdict(diagnosis: Diagnosis, fault: str, degree: float) -> Judged:
    if not diagnosis.findings:
        return Judged(degree, False, degree)
    last = max(diagnosis.findings, key=lambda f: f.until)
    return Judged(degree, last.fault.id == fault, abs(last.degree - degree))
