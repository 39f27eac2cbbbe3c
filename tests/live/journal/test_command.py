"""`rulec journal`: what people and scripts get."""

import csv
import io
import json
import re
import sqlite3
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rulec_runtime.cli import main as station
from rulec_runtime.live.journal.store import open_journal
from rulec_runtime.output.terminal import is_shown

from rulec.cli import main
from tests.hostile.texts import FORMULAS, MARKUP, STEERING
from tests.live.journal.events import LEAKAGE, event, event_in, story


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", "80")
    path = str(tmp_path / "j.db")
    with closing(open_journal(path)) as journal:
        journal.commit("abc", story(), b"state")
    return path


def test_finding_first(file: str, capsys: pytest.CaptureFixture[str]) -> None:
    for command in (main, station):
        assert command(["journal", file]) == 0
        lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
        assert lines[:5] == [
            "▲ S out of specification: one active",
            "▲ S  A.leakage 0.170 (0.150 to 0.190) since 2023-11-14 22:13:20",
            "     leakage past the impeller of A",
            "     do: check the wear ring",
            "     also possible: A.clogging (10 %)",
        ]
        assert "  22:13:24  ✓ ok  ended    B.p healthy again; from 22:13:20 to 22:13:40" in lines
        assert "  22:13:22  ▼ C   began    B.p stands still; since 22:13:20" in lines
        assert max(map(len, lines)) <= 80


def test_filters(file: str, capsys: pytest.CaptureFixture[str]) -> None:
    def printed(code: int, *options: str) -> str:
        assert main(["journal", file, *options]) == code
        return capsys.readouterr().out

    def events(*options: str) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = json.loads(printed(0, *options, "--json", "-"))["events"]
        return found

    printed(3, "--fail-on", "F,S")
    printed(0, "--fail-on", "F,C,M")  # B.p is healthy again
    printed(0, "--kind", "sensor", "--fail-on", "F,C,S,M")
    since = ("--since", "2023-11-14T22:13:22", "--until", "2023-11-14T23:13:23+01:00")
    assert [event_in(record) for record in events(*since)] == story()[1:3]
    rows = list(csv.DictReader(io.StringIO(printed(0, "--active", "--csv", "-"))))
    assert [row["number"] for row in rows] == ["3"]
    assert len(printed(0, "--status", "M", "--csv", "-").splitlines()) == 1
    said = printed(0, "--ack", LEAKAGE.id, "--by", "Ann")
    assert "A.leakage@1700000000.000 of abc: acknowledged" in said
    assert "somebody had acknowledged it before" in printed(0, "--ack", LEAKAGE.id, "--by", "Ben")
    said = " ".join(printed(0).split())
    assert re.search(r"acknowledged by Ann, 20\d\d-\d\d-\d\d \d\d:\d\d:\d\d UTC", said)
    assert [record["acknowledged_by"] for record in events()] == ["Ann", None, "Ann", None]


def test_mistakes_are_told(file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty, damaged = tmp_path / "empty", tmp_path / "damaged"
    empty.touch()
    damaged.write_bytes(Path(file).read_bytes()[:5000] + b"\xff" * 90000)
    for code, arguments, words in (
        (1, [str(tmp_path / "none")], "there is no journal"),
        (1, [str(empty)], "is empty, it holds no journal"),
        (1, [str(damaged)], "malformed"),
        (1, ["postgresql://ann:secret@127.0.0.1:1/x"], "refused"),
        (1, [""], "is no file"),
        (1, [file, "--plant", "xyz"], "holds nothing of xyz; it holds abc"),
        (1, [file, "--ack", "x", "--by", "Ann"], "holds no episode x"),
        (1, [file, "--ack", "\0\udcff", "--by", "\udcff"], "holds no episode"),
        (1, [file, "--plant", "\udcff"], "holds nothing of"),
        (1, [file, "--ack", "x"], "give both --ack EPISODE and --by NAME"),
        (2, [file, "--csv", "no/such/file.csv"], "there is no folder"),
        (2, [file, "--csv", "-", "--json", "-"], "only one of"),
    ):
        assert main(["journal", *arguments]) == code, arguments
        said = capsys.readouterr().err
        assert words in said
        assert "Traceback" not in said
        assert "secret" not in said
    assert not (tmp_path / "none").exists()
    wrong = {"--since": "\x1b[2J", "--status": "X", "--kind": "[/]", "--until": "nan"}
    for option, value in wrong.items():
        with pytest.raises(SystemExit) as ended:
            main(["journal", file, option, value])
        assert ended.value.code == 2
        assert "\x1b" not in capsys.readouterr().err


TEXTS = [*STEERING.values(), *MARKUP, *FORMULAS, "x" * 10_000, "\0\ud800"]


@pytest.mark.parametrize(
    "change",
    [
        "DELETE FROM states",
        "UPDATE events SET status = substr(text, 1, 9), what = substr(text, 1, 9)",
    ],
    ids=["our own events", "what somebody else has written into the database"],
)
def test_hostile_texts_steer_nothing(
    change: str, file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(open_journal(file)) as journal:
        for text in TEXTS:
            names = dict.fromkeys(("id", "subject", "module", "text", "action", "unit"), text)
            odd = replace(LEAKAGE, status="F", alternatives=((text, 0.2),), **names)
            plant = text.replace("\ud800", "").replace("\0", "") or "null"
            journal.commit(plant, [event(1, odd, text=text)], None)
    with closing(sqlite3.connect(file)) as changed, changed:
        changed.execute(change)
    for arguments in ([], ["--csv", "-"], ["--json", "-"]):
        assert main(["journal", file, *arguments]) == 0
        output = capsys.readouterr()
        assert all(is_shown(sign) or sign == "\n" for sign in output.out + output.err)
        assert output.out.count("cmd") >= 1  # among all of them
    assert main(["journal", file, "--csv", str(tmp_path / "t.csv")]) == 0
    with (tmp_path / "t.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert len(rows) == 1 + len(story()) + len(TEXTS)
    assert not any(c.startswith(("=", "@", "\t")) for row in rows for c in row)
