"""Judge one plant on one day. Any error becomes the reason in its row."""

import hashlib
import json
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.contract.ruleset_file import parse_ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.hidden_faults import coverage_of
from rulec_runtime.diagnosis.verdict_per_sample import trace
from rulec_runtime.output.open_file import check_address
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.terminal import one_line
from rulec_runtime.recordings.csv_table import RecordingRefused
from rulec_runtime.recordings.recording import Recording, recording_of
from rulec_runtime.recordings.recording_file import read_file
from rulec_runtime.report.blindness import blindness
from rulec_runtime.report.json_form import diagnosis_form

FORM = 3
"""Version of the rows; after a change all plant-days are judged again."""

UNREAD = "unread"
"""Status of a plant-day without readable data."""

FINDING = ("kind", "fault", "module", "status", "degree", "lower", "upper", "probability",
           "since", "until", "active", "text", "action")  # fmt: skip
"""Keys kept of a finding of `rulec diagnose --json`."""

POINTS = "points"
"""Key of the operating points of a row: one entry per point and signal, with times in s since 1970,
readings in SI."""

Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Task:
    """A plant-day.

    Attributes
    ----------
    files : addresses of its recordings, in order of their names.
    marks : size and modification time of each file, which show whether it has changed.
    ruleset : hash of the text of the ruleset.
    trace : whether to judge every sample as well.
    """

    plant: str
    day: str
    files: tuple[str, ...]
    marks: tuple[str, ...]
    ruleset: str
    trace: bool

    @property
    def key(self) -> str:
        """Equal for tasks with equal results."""
        text = json.dumps([FORM, asdict(self)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def hash_of(ruleset: str) -> str:
    """Hash of the text of a ruleset."""
    return hashlib.sha256(ruleset.encode()).hexdigest()[:16]


def judge_day(task: Task, ruleset: str) -> Row:
    """The row of a plant-day; `ruleset` is the text of its ruleset.

    Never raises for errors in the files: the row then has status ``unread`` and a reason.
    """
    row = blank(task)
    try:
        rules = _ruleset(ruleset)
        with ExitStack() as stack:
            recording = _recording(task, rules, stack)
            return row | _results(diagnose(recording, rules), recording, task)
    except Exception as error:
        return row | {"reason": reason_of(error, "judged")}


def reason_of(error: Exception, what: str) -> str:
    """Why a plant-day cannot be `what`; not even a bug of ours may stop the other plants."""
    if isinstance(error, Refusal | OSError):
        return one_line(str(error))
    if isinstance(error, MemoryError):
        return "it needs more memory than its worker has"
    return one_line(f"cannot be {what} ({type(error).__name__}: {error})")[:300]


def blank(task: Task) -> Row:
    """The row of a plant-day without results."""
    return {
        "plant": task.plant,
        "day": task.day,
        "key": task.key,
        "ruleset": task.ruleset,
        "status": UNREAD,
        "health": None,
        "coverage": None,
        "samples": 0,
        "judged": 0,
        "reason": "",
        "findings": [],
        "trace": [],
        POINTS: [],
        "notes": [],
    }


@lru_cache(maxsize=64)
def _ruleset(text: str) -> Ruleset:
    return parse_ruleset(json.loads(text))


def _recording(task: Task, ruleset: Ruleset, stack: ExitStack) -> Recording:
    if not task.files:
        raise RecordingRefused("there is no recording of this day")
    notes: list[str] = []
    files = [fetched(file, stack) for file in task.files]
    read = (read_file(file, ruleset, notes) for file in files)
    return recording_of(files[0], read, ruleset, notes)


def fetched(address: str, stack: ExitStack) -> Path:
    """A local path; a remote file is downloaded and exists as long as the stack."""
    if "://" not in address:
        return Path(address)
    import fsspec

    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="rulec-")))
    system, path = fsspec.core.url_to_fs(check_address(address))
    file = folder / Path(path).name
    system.get_file(path, str(file))
    return file


def _results(diagnosis: Diagnosis, recording: Recording, task: Task) -> Row:
    form = diagnosis_form(diagnosis)
    findings = [{name: found.get(name) for name in FINDING} for found in form["findings"]]
    unknown = {
        "kind": "unknown",
        "fault": "unknown",
        "module": "",
        "status": "S",
        "active": False,
        "action": "",
    }
    for period in form["unknown"]:
        own = {name: period[name] for name in ("since", "until", "text")}
        findings.append(dict.fromkeys(FINDING) | unknown | own)
    times = float(recording.time[0]), float(recording.time[-1])
    coverage = coverage_of(diagnosis.ruleset, diagnosis.blind, *times)
    health = round(_healthy_share(*times, findings) * coverage, 6)
    return {
        "status": diagnosis.status,
        "health": health if diagnosis.judged else None,
        "coverage": round(coverage, 6) if diagnosis.judged else None,
        "samples": diagnosis.samples,
        "judged": diagnosis.judged,
        "reason": _reason(diagnosis),
        "findings": sorted(findings, key=lambda f: (f["since"], f["fault"])),
        "trace": _runs(recording, diagnosis) if task.trace else [],
        POINTS: [*_points(diagnosis)],
        "notes": form["notes"],
    }


def _points(diagnosis: Diagnosis) -> Iterator[Row]:
    """Entries of `POINTS`, if the recording has dates."""
    visited, calendar = diagnosis.visited, diagnosis.calendar
    if visited is None or calendar is None:
        return
    for i, samples in enumerate(visited.samples.tolist()):
        since, until = (float(t[i]) + calendar.start for t in (visited.since, visited.until))
        for name, values in visited.values.items():
            if np.isfinite(values[i]):
                yield {
                    "signal": name,
                    "since": since,
                    "until": until,
                    "samples": samples,
                    "value": float(values[i]),
                    "u": float(visited.u[name][i]),
                }


def _reason(diagnosis: Diagnosis) -> str:
    """Why nothing was judged, or what could not be; empty if everything was."""
    if not diagnosis.judged:
        return diagnosis.not_judged[0].text if diagnosis.not_judged else ""
    calendar = diagnosis.calendar
    return ". ".join(blindness(diagnosis.ruleset, one, calendar) for one in diagnosis.blind)


def _healthy_share(begin: float, end: float, findings: Iterable[Row]) -> float:
    """Share of the time of a recording without findings."""
    covered, until = 0.0, begin
    for found in sorted(findings, key=lambda f: float(f["since"])):
        covered += max(float(found["until"]) - max(until, float(found["since"])), 0.0)
        until = max(until, float(found["until"]))
    return 1.0 - covered / (end - begin) if end > begin else 1.0


def _runs(recording: Recording, diagnosis: Diagnosis) -> list[Row]:
    """Verdicts of all samples, merged where successive ones are equal."""
    found = trace(recording, diagnosis.ruleset, diagnosis.mode)
    time, first = np.asarray(found.time), 0
    rows: list[Row] = []
    for verdict, same in groupby(found.verdict):
        count = sum(1 for _ in same)
        degrees = found.degree[:, first : first + count].max(axis=1, initial=0.0)
        rows.append(
            {
                "since": float(time[first]),
                "until": float(time[first + count - 1]),
                "samples": count,
                "verdict": verdict,
                "largest_degree": float(degrees.max(initial=0.0)),
            }
        )
        first += count
    return rows
