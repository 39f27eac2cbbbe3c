"""`rulec journal`: what people and scripts get."""

from __future__ import annotations

import csv
import io
import json
import re
import sqlite3
from dataclasses import replace
from pathlib import Path

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
    journal = open_journal(path)
    journal.commit("abc", story(), b"state")
    journal.close()
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
        assert "  22:13:24  ▼ C  ended    B.p healthy again" in lines
        assert max(map(len, lines)) <= 80


def test_filters_and_exit_code(file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["journal", file, "--fail-on", "F,S"]) == 3
    assert main(["journal", file, "--fail-on", "F,C,M"]) == 0  # B.p is healthy again
    assert main(["journal", file, "--kind", "sensor", "--fail-on", "F,C,S,M"]) == 0
    capsys.readouterr()
    since = ["--since", "2023-11-14T22:13:22", "--until", "2023-11-14T23:13:23+01:00"]
    assert main(["journal", file, *since, "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [event_in(record) for record in data["events"]] == story()[1:3]
    assert main(["journal", file, "--active", "--csv", "-"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert [row["number"] for row in rows] == ["3"]
    assert main(["journal", file, "--status", "M", "--csv", "-"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 1


def test_take_note(file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["journal", file, "--ack", LEAKAGE.id, "--by", "Ann"]) == 0
    assert "A.leakage@1700000000.000 of abc: acknowledged" in capsys.readouterr().out
    assert main(["journal", file, "--ack", LEAKAGE.id, "--by", "Ben"]) == 0
    assert "somebody had acknowledged it before" in capsys.readouterr().out
    assert main(["journal", file, "--json", file + ".json"]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert re.search(r"acknowledged by Ann, 20\d\d-\d\d-\d\d \d\d:\d\d:\d\d UTC", told)
    assert re.search(r"Acknowledged newest .* Ann, .* UTC: A.leakage since 2023-11-14 22:1", told)
    data = json.loads(Path(file + ".json").read_text())
    assert [record["acknowledged_by"] for record in data["events"]] == ["Ann", None, "Ann", None]


def test_mistakes_are_told(file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty, damaged = tmp_path / "empty", tmp_path / "damaged"
    empty.touch()
    damaged.write_bytes(Path(file).read_bytes()[:5000] + b"\xff" * 90000)
    for arguments, words in (
        ([str(tmp_path / "none")], "there is no journal"),
        ([str(empty)], "is empty, it holds no journal"),
        ([str(damaged)], "malformed"),
        (["postgresql://ann:secret@127.0.0.1:1/x"], "refused"),
        ([""], "is no file"),
        ([file, "--plant", "xyz"], "holds nothing of xyz; it holds abc"),
        ([file, "--ack", "x", "--by", "Ann"], "holds no episode x"),
        ([file, "--ack", "\0\udcff", "--by", "\udcff"], "holds no episode"),
        ([file, "--plant", "\udcff"], "holds nothing of"),
        ([file, "--ack", "x"], "give both --ack EPISODE and --by NAME"),
        ([file, "--csv", "no/such/file.csv"], "there is no such folder"),
        ([file, "--csv", "-", "--json", "-"], "only one of"),
    ):
        wrong_usage = words in ("there is no such folder", "only one of")
        assert main(["journal", *arguments]) == (2 if wrong_usage else 1), arguments
        said = capsys.readouterr().err
        assert words in said
        assert "Traceback" not in said
        assert "secret" not in said
    for option, value in (
        ("--since", "\x1b[2J"),
        ("--status", "X"),
        ("--kind", "[/]"),
        ("--until", "nan"),
    ):
        with pytest.raises(SystemExit) as ended:
            main(["journal", file, option, value])
        assert ended.value.code == 2
        assert "\x1b" not in capsys.readouterr().err


@pytest.mark.parametrize("text", [*STEERING.values(), *MARKUP, *FORMULAS, "x" * 10_000, "\0\ud800"])
def test_hostile_texts_steer_nothing(
    text: str, file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nor do they in what somebody else has written into the database."""
    names = dict.fromkeys(("id", "subject", "module", "text", "action", "unit"), text)
    odd = replace(LEAKAGE, status="F", alternatives=((text, 0.2),), **names)
    journal = open_journal(file)
    journal.commit(
        text.replace("\0", "").replace("\ud800", "") or "x", [event(1, odd, text=text)], None
    )
    journal.close()
    with sqlite3.connect(file) as changed:
        changed.execute(
            "UPDATE events SET status = ?, what = ? WHERE kind = 'sensor'",
            (text[:9].replace("\ud800", ""),) * 2,
        )
    changed.close()
    for arguments in ([], ["--csv", "-"], ["--json", "-"]):
        assert main(["journal", file, *arguments]) == 0
        told = capsys.readouterr()
        assert all(is_shown(sign) or sign == "\n" for sign in told.out + told.err)
    assert main(["journal", file, "--csv", str(tmp_path / "t.csv")]) == 0
    with (tmp_path / "t.csv").open(newline="") as stream:
        for row in csv.reader(stream):
            assert not any(c.startswith(("=", "@", "\t")) for c in row)
