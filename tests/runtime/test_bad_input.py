"""`rulec diagnose` on what goes wrong in plants: a message or "cannot judge", never an alarm.

A case is the healthy example with one thing bent. Nothing is wrong with the plant in it, so a
finding would be an alarm from an invalid reading.
"""

from __future__ import annotations

import contextlib
import csv
import functools
import gzip
import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.contract.plan import CHUNK
from rulec_runtime.contract.ruleset import Ruleset

from rulec.cli import main
from tests.conftest import SOURCES, compiled
from tests.runtime.sheets import Sheet, example, write

SHEET = example()
MANY = 3 * CHUNK + 1_000
STANDSTILL = {"A.n": "0", "A.dp": "0.02", "A.P_el": "12", "B.n": "0", "B.dp": "0.02", "C.dp": "0"}


@dataclass
class Outcome:
    """What a call gave."""

    code: int
    out: str
    err: str
    data: dict[str, Any] = field(default_factory=dict)

    def reasons(self) -> str:
        """What is the matter with readings, and why something was not judged."""
        told = [period["because"] for period in self.data["not_judged"]]
        told += [f["text"] for f in self.data["findings"] if f["kind"] == "sensor"]
        return "; ".join(told)


@pytest.fixture(scope="module")
def ruleset_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plant abc, compiled."""
    file = tmp_path_factory.mktemp("ruleset") / "abc.ruleset.json"
    file.write_text(compiled("abc").to_json(), encoding="utf-8")
    return file


def diagnose(ruleset: Path, recording: Path, *more: str) -> Outcome:
    """`rulec diagnose`, in this process; its JSON is read strictly."""
    target = recording.parent / "out.json"
    target.unlink(missing_ok=True)
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main(["diagnose", str(ruleset), str(recording), "--json", str(target), *more])
    outcome = Outcome(code, out.getvalue(), err.getvalue())
    if target.is_file():
        outcome.data = strict(target.read_text(encoding="utf-8"))
    return outcome


@pytest.fixture(scope="module")
def answer(
    ruleset_file: Path, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[str, str], Outcome]:
    """What is said of a case in a mode; asked once."""

    @functools.cache
    def asked(name: str, mode: str) -> Outcome:
        recording = write(tmp_path_factory.mktemp("case"), bent(name))
        return diagnose(ruleset_file, recording, "--mode", mode)

    return asked


def strict(text: str) -> Any:
    """JSON without NaN and infinity."""

    def refuse(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    return json.loads(text, parse_constant=refuse)


def check_form(data: dict[str, Any], ruleset: Ruleset) -> None:
    """The form that design.md fixes."""
    wanted = {
        "plant",
        "ruleset",
        "samples",
        "judged",
        "status",
        "findings",
        "unknown",
        "not_judged",
        "blind",
    }
    assert wanted <= set(data)
    assert data["status"] in ("F", "C", "S", "M", "ok")
    assert 0 <= data["judged"] <= data["samples"]
    faults = {f.id for f in ruleset.faults}
    residuals = {r.id for r in ruleset.residuals}
    for finding in data["findings"]:
        assert 0.0 <= finding["duration"] == finding["until"] - finding["since"]
        if finding["kind"] == "sensor":
            assert finding["fault"].rpartition(".")[0] in {"time", *ruleset.signal_by_id}
            assert {"F", "C"} >= {finding["status"]}
            assert (1.0, 1.0, []) == tuple(finding[k] for k in ("degree", "lower", "evidence"))
            continue
        assert finding["fault"] in faults
        assert finding["module"] == finding["fault"].split(".")[0]
        assert finding["lower"] <= finding["degree"] <= finding["upper"]
        assert 0.0 <= finding["probability"] <= 1.0
        assert finding["since"] <= finding["until"]
        assert {a["fault"] for a in finding["alternatives"]} <= faults - {finding["fault"]}
        assert finding["text"]
        for row in finding["evidence"]:
            assert {"residual", "value", "u", "threshold", "verdict", "expected"} <= set(row)
            assert row["residual"] in residuals
            assert row["verdict"] in ("+", "-", "0", "invalid")
            assert row["expected"] in ("+", "-", "0")
    for period in data["unknown"]:
        assert {"since", "until", "text"} == set(period)
    for period in data["not_judged"]:
        assert {"since", "until", "because"} == set(period)
        assert period["because"]
    for period in data["blind"]:
        assert {"faults", "since", "until", "because", "readings"} == set(period)
        assert set(period["faults"]) <= faults
        assert {r.rpartition(".")[0] for r in period["readings"]} <= set(ruleset.modules)
        assert data["status"] in ("F", "C")


def bent(name: str) -> str | bytes:
    """The content of a case."""
    sheet = CASES[name]
    return sheet.text() if isinstance(sheet, Sheet) else sheet


def standstill(sheet: Sheet) -> Sheet:
    for column, value in STANDSTILL.items():
        sheet = sheet.filled(column, value)
    return sheet


CASES: dict[str, Sheet | str | bytes] = {
    "healthy": SHEET,
    "two samples": Sheet(SHEET.header, SHEET.rows[:2]),
    "one sample": Sheet(SHEET.header, SHEET.rows[:1]),
    "column without readings": SHEET.filled("A.dp", ""),
    "all columns without readings": Sheet(
        SHEET.header, tuple((row[0], *[""] * 13) for row in SHEET.rows)
    ),
    "readings lost in turn": SHEET.mapped("A.dp", lambda k, c: "" if k % 3 == 0 else c),
    "words between readings": SHEET.mapped("A.dp", lambda k, c: "Bad" if k % 5 == 0 else c),
    "column missing": SHEET.without("A.dp"),
    "only time and one column": SHEET.without(
        *[title.split(" [")[0] for title in SHEET.header if not title.startswith(("time", "A.dp"))]
    ),
    "stuck after a while": SHEET.filled("A.dp", SHEET.rows[30][2], 30),
    "stuck from the start": SHEET.filled("A.dp", SHEET.rows[20][2]),
    "beyond the range": SHEET.filled("A.dp", "15"),
    "below the range": SHEET.filled("A.dp", "-3"),
    "at the upper end": SHEET.filled("C.dp", "2.2"),
    "speed zero": SHEET.filled("A.n", "0"),
    "speed below its minimum": SHEET.filled("A.n", "30"),
    "speed negative": SHEET.filled("A.n", "-900"),
    "standstill": standstill(SHEET),
    "pressure zero": SHEET.filled("A.dp", "0"),
    "pressure zero for a while": SHEET.filled("A.dp", "0", 20, 40),
    "negative root": SHEET.filled("C.dp", "1.9"),
    "power infinite": SHEET.filled("A.P_el", "inf"),
    "power 1e300": SHEET.filled("A.P_el", "1e300"),
    "power 1e300 once": SHEET.filled("A.P_el", "1e300", 7, 8),
    "pressure 1e300": SHEET.filled("A.dp", "1e300"),
    "power -9999": SHEET.filled("A.P_el", "-9999"),
    "power 65535": SHEET.filled("A.P_el", "65535"),
    "spike": SHEET.filled("A.dp", "9", 30, 31),
    "repeated times": SHEET.mapped("time", lambda k, _: str(k // 2)),
    "one time": SHEET.filled("time", "5"),
    "backwards": Sheet(SHEET.header, SHEET.rows[::-1]),
    "gap": SHEET.mapped("time", lambda k, _: str(k + 1000 * (k >= 30))),
    "times near 1e9": SHEET.mapped("time", lambda k, _: str(1_700_000_000 + k)),
    "German": SHEET.german(),
    "gz": gzip.compress(SHEET.text().encode()),
    "ragged": SHEET.text().replace("\n10,", "\n10,,").replace("\n20,", "\n20\n"),
}

KNOWN = {
    "negative root": (
        "a root's failing argument condemns one observer, not its readings",
        "default",
    ),
}
"""Alarms from invalid readings today: why, and in which modes."""


def known_gap(name: str, mode: str) -> Any:
    reason, modes = KNOWN.get(name, ("", ""))
    return pytest.mark.xfail(reason=reason, strict=True) if mode in modes.split() else ()


@pytest.mark.parametrize(
    ("name", "mode"),
    [
        pytest.param(name, mode, marks=known_gap(name, mode))
        for name in CASES
        for mode in ("default", "paper")
    ],
)
def test_never_an_alarm(
    name: str, mode: str, answer: Callable[[str, str], Outcome], abc: Ruleset
) -> None:
    """JSON of the fixed form, no fault of the plant and nothing unknown: what is found is the
    sensor, and no other one. Exit 3 where not all could be seen, else 0."""
    outcome = answer(name, mode)
    assert "" == outcome.err
    assert outcome.code == (3 if outcome.data["blind"] or not outcome.data["judged"] else 0)
    check_form(outcome.data, abc)
    assert TOLD.get(name, set()) == {f["fault"] for f in outcome.data["findings"]}
    assert [] == outcome.data["unknown"]
    letters = {f["status"] for f in outcome.data["findings"]}
    assert not letters or outcome.data["status"] in letters


TOLD = {
    "stuck after a while": {"A.dp.stuck"},
    "stuck from the start": {"A.dp.stuck"},
    "beyond the range": {"A.dp.range"},
    "below the range": {"A.dp.range"},
    "at the upper end": {"C.dp.range"},
    "speed zero": {"A.n.dead"},
    "speed negative": {"A.n.dead"},
    "pressure zero": {"A.dp.dead"},
    "pressure zero for a while": {"A.dp.dead"},
    "one time": {"time.jump"},
    "power -9999": {"A.P_el.range"},
    "power 65535": {"A.P_el.range"},
}
"""What is said of the sensor."""

BECAUSE = {
    "two samples": "the recording has 2 samples; a settled stretch needs 3",
    "one sample": "the recording has 1 sample; a settled stretch needs 3",
    "one time": "the recording has 1 sample; a settled stretch needs 3",
    "all columns without readings": "A.dp: no reading",
    "only time and one column": "A.n is not in the recording",
    "standstill": "is below",
    "column without readings": "A.dp: no reading",
    "column missing": "A.dp is not in the recording",
    "stuck after a while": "A.dp: stuck at one value",
    "beyond the range": "A.dp: outside the sensor's range",
    "below the range": "A.dp: outside the sensor's range",
    "at the upper end": "C.dp: outside the sensor's range",
    "speed zero": "A.n is dead: it reads 0 rpm",
    "speed below its minimum": "A.n is below 40 rpm",
    "speed negative": "A.n is dead: it reads -900 rpm",
    "pressure zero": "A.dp",
    "negative root": "is not positive",
    "power infinite": "A.P_el: no reading",
    "power 1e300": "A.P_el: no reading",
    "pressure 1e300": "A.dp: no reading",
}


@pytest.mark.parametrize("name", BECAUSE)
def test_says_why_it_cannot_judge(name: str, answer: Callable[[str, str], Outcome]) -> None:
    """The reason is told with the reading's name, also for one module alone."""
    outcome = answer(name, "default")
    assert BECAUSE[name] in outcome.reasons()


NOTHING = ["two samples", "one sample", "one time", "all columns without readings", "standstill"]


@pytest.mark.parametrize("name", [*NOTHING, "only time and one column"])
def test_nothing_judged_is_check_function(name: str, answer: Callable[[str, str], Outcome]) -> None:
    """Where nothing at all could be judged the status is C, not ok."""
    outcome = answer(name, "default")
    assert ("C", 0) == (outcome.data["status"], outcome.data["judged"])


def test_a_real_fault_is_found_beside_a_dead_sensor(tmp_path: Path, ruleset_file: Path) -> None:
    """B's pressure is lost, so the mixer's balance is open; the leakage in A is named all the same.

    What is left, A's own estimates, fits a wider line as well: both are said.
    """
    sheet = example("leakage_A").filled("B.dp", "Bad")
    data = diagnose(ruleset_file, write(tmp_path, sheet.text())).data
    findings = data["findings"]
    assert ("C", [["B.dp"]]) == (data["status"], [b["readings"] for b in data["blind"]])
    assert findings
    for finding in findings:
        named = {finding["fault"], *(a["fault"] for a in finding["alternatives"])}
        assert {"A.leakage", "A.widening"} <= named
        assert {"A"} == {name.split(".")[0] for name in named}


@pytest.mark.parametrize("name", ["healthy", "German", "gz", "backwards", "gap", "times near 1e9"])
def test_all_of_a_healthy_recording_is_judged(
    name: str, answer: Callable[[str, str], Outcome]
) -> None:
    """Form, order and pauses take nothing away."""
    outcome = answer(name, "default")
    assert ("ok", 60, []) == tuple(outcome.data[k] for k in ("status", "judged", "not_judged"))


def test_recording_of_another_plant_with_the_same_names(tmp_path: Path, ruleset_file: Path) -> None:
    """Its C is a dosing module, ours a mixer: that is said."""
    sheet = Sheet((*SHEET.header, "C.n [rpm]"), tuple((*row, "900") for row in SHEET.rows))
    outcome = diagnose(ruleset_file, write(tmp_path, sheet.text()))
    assert any("is this a recording of another plant?" in n for n in outcome.data["notes"])


def test_folder_of_recordings(tmp_path: Path, ruleset_file: Path, abc: Ruleset) -> None:
    """Three files one behind the other; a finding knows when it began in that order."""
    folder = tmp_path / "recordings"
    folder.mkdir()
    for name, sheet in (("1", SHEET), ("2", example("leakage_A")), ("3", SHEET)):
        write(folder, sheet.text(), f"{name}.csv")
    outcome = diagnose(ruleset_file, folder)
    check_form(outcome.data, abc)
    assert 200 == outcome.data["samples"]
    assert {"A.leakage"} == {f["fault"] for f in outcome.data["findings"]}
    assert all(60 <= f["since"] < f["until"] < 140 for f in outcome.data["findings"])


@pytest.mark.parametrize("mode", ["default", "paper"])
def test_form_of_a_diagnosis_with_findings(
    mode: str, tmp_path: Path, ruleset_file: Path, abc: Ruleset
) -> None:
    """The shipped leakage: findings with evidence, all in the fixed form."""
    recording = write(tmp_path, example("leakage_A").text())
    outcome = diagnose(ruleset_file, recording, "--mode", mode)
    check_form(outcome.data, abc)
    assert "A.leakage" in {f["fault"] for f in outcome.data["findings"]}
    assert all(f["evidence"] for f in outcome.data["findings"])


def test_trace_has_one_row_per_sample(tmp_path: Path, ruleset_file: Path, abc: Ruleset) -> None:
    """Time, verdict, and per fault degree and bounds; numbers everywhere."""
    target = tmp_path / "trace.csv"
    recording = write(tmp_path, example("leakage_A").text())
    assert 0 == diagnose(ruleset_file, recording, "--trace", str(target)).code
    with target.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    assert ["time [s]", "verdict"] == header[:2]
    assert [c for f in abc.faults for c in (f.id, f"{f.id} lower", f"{f.id} upper")] == header[2:]
    assert [float(row[0]) for row in rows] == [float(k) for k in range(80)]
    verdicts = {f.id for f in abc.faults} | {"ok", "unknown", "outside", "moving", "cannot judge"}
    assert {row[1] for row in rows} <= verdicts
    for row in rows:
        numbers = [float(cell) for cell in row[2:]]
        assert all(n == n and abs(n) < float("inf") for n in numbers)
        triples = zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True)
        assert all(lower <= degree <= upper for degree, lower, upper in triples)
    assert "A.leakage" in {row[1] for row in rows[30:40]}


@pytest.mark.parametrize("name", ["pressure 1e300", "column without readings", "one sample"])
def test_trace_of_bad_readings(name: str, tmp_path: Path, ruleset_file: Path) -> None:
    """No NaN, no fault."""
    target = tmp_path / "trace.csv"
    diagnose(ruleset_file, write(tmp_path, bent(name)), "--trace", str(target))
    text = target.read_text(encoding="utf-8")
    assert not {"nan", "inf", "-inf"} & set(text.replace("\n", ",").split(","))
    assert {row.split(",")[1] for row in text.splitlines()[1:]} <= {"ok", "moving", "cannot judge"}


def test_many_rows(tmp_path: Path, ruleset_file: Path) -> None:
    """More than a plan takes at once, nothing found in them."""
    bodies = [",".join(row[1:]) for row in SHEET.rows]
    lines = [f"{k},{bodies[k % 60]}" for k in range(MANY)]
    content = ",".join(SHEET.header) + "\n" + "\n".join(lines)
    outcome = diagnose(ruleset_file, write(tmp_path, content))
    assert ("ok", MANY) == (outcome.data["status"], outcome.data["samples"])


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": SOURCES, "PYTHONWARNINGS": "error"}
    call = [sys.executable, "-m", "rulec", *arguments]
    return subprocess.run(call, capture_output=True, text=True, env=environment, check=False)


def test_json_on_standard_output_is_alone_there(tmp_path: Path, ruleset_file: Path) -> None:
    """`--json -`: the story goes to standard error, so that a pipe gets JSON only."""
    recording = write(tmp_path, example("leakage_A").text())
    done = command("diagnose", str(ruleset_file), str(recording), "--json", "-")
    assert 0 == done.returncode
    assert "A.leakage" in {f["fault"] for f in strict(done.stdout)["findings"]}
    assert "maintenance required" in done.stderr


WRONG_CALLS = [
    (("nothing.json", "x.csv"), 1, "nothing.json"),
    (("{ruleset}", "nothing.csv"), 1, "there is no such file"),
    (("{ruleset}", "{ruleset}"), 1, "no time column"),
    (("{ruleset}", "/dev/null"), 1, "rulec: /dev/null"),
    (("{recording}", "{recording}"), 1, ""),
    (("{ruleset}", "{recording}", "--json", "/nowhere/out.json"), 2, "--json /nowhere"),
    (("{ruleset}", "{recording}", "--trace", "/nowhere/out.csv"), 2, "--trace /nowhere"),
    (("{ruleset}",), 2, "usage"),
    (("{ruleset}", "x.csv", "--mode", "guess"), 2, "usage"),
]


@pytest.mark.parametrize(("arguments", "code", "message"), WRONG_CALLS)
def test_wrong_calls_give_a_message(
    arguments: tuple[str, ...],
    code: int,
    message: str,
    tmp_path: Path,
    ruleset_file: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code and message, no exception; argparse leaves by itself for wrong usage."""
    recording = write(tmp_path, SHEET.text(), "healthy.csv")
    filled = [a.format(ruleset=ruleset_file, recording=recording) for a in arguments]
    try:
        found = main(["diagnose", *filled])
    except SystemExit as leaving:
        found = leaving.code
    assert (code, True) == (found, message in capsys.readouterr().err)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (bytes(range(256)) * 9, "export the recording as CSV"),
        ("", "the file is empty"),
        ("time [s],PS1 [bar]\n0,160\n", "no column belongs to this plant"),
    ],
)
def test_no_traceback_in_a_shell(
    content: str | bytes, message: str, tmp_path: Path, ruleset_file: Path
) -> None:
    """As a process: exit 1, one line on standard error that names the file, no JSON."""
    recording = write(tmp_path, content)
    done = command("diagnose", str(ruleset_file), str(recording), "--json", "-")
    assert (1, "") == (done.returncode, done.stdout)
    assert done.stderr.startswith(f"rulec: {recording}: ")
    assert message in done.stderr
    assert 1 == done.stderr.count("\n")
