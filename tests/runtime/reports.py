"""Recordings judged for a report, and what stands in the page; pages of a mismatch."""

import dataclasses
import functools
import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.verdict_per_sample import Trace, trace
from rulec_runtime.output.terminal import Terminal
from rulec_runtime.recordings.plant_calendar import Calendar
from rulec_runtime.recordings.recording import Recording, read_recording
from rulec_runtime.report.page import report
from rulec_runtime.report.series import Curves, curves_of
from rulec_runtime.report.subject import Subject
from rulec_runtime.report.truth import Truth, read_truth

from rulec.mismatch.answer.terminal_and_page import report as mismatch_report
from rulec.mismatch.result import Mismatch
from tests.conftest import ROOT, compiled

EXAMPLES = ROOT / "plants" / "abc" / "examples"

NO_NUMBER = re.compile(r"[ \"(]-?(?:nan|inf)\b")
"""Numbers that no page may show."""

NEEDS_MORE = re.compile(r"https?:|//\w|<script|<img|<link|@import|url\(|\ssrc=|\son\w+=")
"""What would make a page depend on something else."""

MADE = "2026-09-22 08:15 UTC by rulec 1.2.3"

CALENDAR = Calendar(1789948760.0, ((0.0, 7200.0),))
"""Time 0 is 2026-09-21 01:59:20 in a zone two hours before UTC."""


@dataclasses.dataclass(frozen=True, eq=False)
class Judged:
    recording: Recording
    diagnosis: Diagnosis
    trace: Trace
    truth: Truth | None

    def page(self, name: str = "x.csv") -> str:
        """The page of a file of this name."""
        return page_of(self, name)

    def curves(self) -> Curves:
        return curves_of(self.recording, self.diagnosis, self.trace)


@functools.lru_cache(maxsize=8)
def page_of(judged: Judged, name: str) -> str:
    made = "2026-09-22 08:15 UTC by rulec-runtime 1.2.3"
    return report(judged.recording, judged.diagnosis, judged.trace, name, judged.truth, made)


def judge(path: Path, ruleset: Ruleset, truth: Path | None = None) -> Judged:
    recording = read_recording(path, ruleset)
    degrees = read_truth(truth, ruleset, recording) if truth else None
    return Judged(recording, diagnose(recording, ruleset), trace(recording, ruleset), degrees)


def shown(tell: Callable[[Terminal, Any], None], what: object, width: int = 120) -> str:
    """What a terminal of some width shows."""
    out = io.StringIO()
    tell(Terminal(file=out, width=width, color_system=None), what)
    return out.getvalue().replace("\xa0", " ")


def tree(page: str) -> ET.Element:
    return ET.fromstring(page)


def figures(page: str) -> list[str | None]:
    return [f.get("id") for f in tree(page).iter("figure")]


def subject() -> Subject:
    return Subject(ruleset=compiled("abc"), recording="warm.csv", samples=400, ends=(0.0, 399.0))


def mismatch_page(mismatch: Mismatch) -> str:
    return mismatch_report(mismatch, subject(), MADE)


def dated(judged: Judged) -> Judged:
    return dataclasses.replace(
        judged,
        recording=dataclasses.replace(judged.recording, calendar=CALENDAR),
        diagnosis=dataclasses.replace(judged.diagnosis, calendar=CALENDAR),
    )
