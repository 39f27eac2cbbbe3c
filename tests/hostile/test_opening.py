"""One module opens what somebody gave, and decides what may be opened."""

from __future__ import annotations

import ast
import contextlib
import io
import os
import socket
from pathlib import Path

import pytest
from rulec_runtime.output.open_file import (
    FOLDERS,
    SCHEMES,
    begin_of,
    bytes_of,
    check_address,
    is_near,
    opened,
    text_of,
)
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.recordings import formats, limits

from tests.conftest import ROOT
from tests.hostile.test_writing import SOURCES

OPENER = "runtime/rulec_runtime/output/open_file.py"

OPENS = {"open", "fdopen", "read_text", "read_bytes", "fromfile", "memmap", "ZipFile", "GzipFile"}
OPENS |= {"url_to_fs", "get_file", "np.load", "tls_set", "sqlite3.connect"}
"""Calls by which a file comes to be read."""

BESIDE = {
    "rulec/commands/schema.py": "schemas that are shipped",
    "rulec/commands/init.py": "skeletons that are shipped",
    "rulec/curves/sheet.py": "names of columns and grades that are shipped",
    "rulec/demo/servers.py": "recordings that are shipped",
    "rulec/demo/played_recording.py": "recordings that are shipped",
    "rulec/effects/write_plant.py": "schemas that are shipped",
    "rulec/language/schema.py": "schemas that are shipped",
    "rulec/mtp/tables.py": "tables that are shipped",
    "rulec/commands/fleet.py": "answers that the fleet wrote itself",
    "rulec/fleet/plant_days.py": "an address that was checked",
    "runtime/rulec_runtime/fleet/plant_day.py": "an address that was checked",
    "rulec/mtp/caex.py": "bytes that were read",
    "runtime/rulec_runtime/live/state.py": "bytes that were read",
    "runtime/rulec_runtime/recordings/text_file.py": "a file that is open",
    "runtime/rulec_runtime/live/journal/database.py": "a file that was looked into",
    "runtime/rulec_runtime/live/journal/mqtt_out.py": "a file that was looked into",
    "runtime/rulec_runtime/live/sources/mqtt.py": "files that were found to be regular",
    "runtime/rulec_runtime/commands/frame.py": "the null device",
    "runtime/rulec_runtime/live/journal/tables.py": "what the system says of itself",
    "runtime/rulec_runtime/live/view/live_screen.py": "the terminal",
    "runtime/rulec_runtime/output/append_file.py": "to append; it looks for itself",
    "runtime/rulec_runtime/output/private_folder.py": "the user's own folder; it looks for itself",
    "runtime/rulec_runtime/output/write_file.py": "to write",
}
"""Who else opens something, and what."""

FOLDERS_BESIDE = {
    "rulec/prove/": "cases and answers that the proof wrote itself",
    "runtime/rulec_runtime/recordings/readers/": "a file that is open",
}


def test_nobody_opens_beside_it() -> None:
    """Whoever does stands in the list, with what it opens."""
    found = {
        file.relative_to(ROOT).as_posix()
        for file in SOURCES
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        and OPENS & {ast.unparse(node.func), ast.unparse(node.func).rpartition(".")[2]}
        and "__file__" not in ast.unparse(node.func)
    }
    assert {*BESIDE, OPENER} == {f for f in found if not f.startswith(tuple(FOLDERS_BESIDE))}


def test_regular_files_alone_are_opened(tmp_path: Path) -> None:
    """Links to them, too; sizes are looked at before anything is read."""
    (tmp_path / "file").write_bytes(b"\xef\xbb\xbf1\r\n")
    (tmp_path / "link").symlink_to("file")
    assert "1\n" == text_of(tmp_path / "link", 6)
    assert b"\xef" == begin_of(tmp_path / "file", 1)
    with pytest.raises(OSError, match="more than 0 MB"):
        bytes_of(tmp_path / "file", 5)
    with (tmp_path / "large").open("wb") as file:
        file.truncate(2**40)
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(tmp_path / "socket"))
    (tmp_path / "away").symlink_to("pipe")
    for name in ("large", "pipe", "socket", "away", ".", "/dev/zero", "/dev/tty", "none"):
        with pytest.raises(OSError, match=r"this is no file but|it has more|No such"):
            opened(tmp_path / name)


def test_standard_input_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes there stays in memory, so it has an end."""
    monkeypatch.setattr(limits, "LARGEST_PIPE", 10)
    for length in (10, 11):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"x" * length)))
        with contextlib.nullcontext() if length == 10 else pytest.raises(Refusal, match="give a f"):
            assert b"x" * 10 == formats.bytes_of(Path("-"))


def test_what_is_near(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Below the folder, or the one around it, unless that is the root of all; links followed."""
    plant, far = tmp_path / "line" / "plant", tmp_path / "far" / "x"
    plant.mkdir(parents=True)
    far.parent.mkdir()
    (plant / "link").symlink_to(far)
    (plant / "beside").symlink_to("../other/x")
    seen = {n: is_near(plant / n, plant) for n in ("x", "../o/x", "../../far/x", "link", "beside")}
    assert {"x": True, "../o/x": True, "../../far/x": False, "link": False, "beside": True} == seen
    assert not is_near(Path("/etc/shadow"), plant)
    assert not is_near(Path("/etc/shadow"), Path("/plant"))
    monkeypatch.setenv(FOLDERS, os.pathsep.join(["", str(far.parent)]))
    assert is_near(plant / "link", plant)
    assert not is_near(plant / "../../else", plant)


NO_SCHEMES = "reference data generic tar zip memory ftp ssh git github smb hdfs local dir"


def test_addresses_are_of_schemes_that_are_meant() -> None:
    for scheme in (*NO_SCHEMES.split(), "simplecache::s3", "s3://x::https"):
        with pytest.raises(Refusal, match="is no address that recordings are read from"):
            check_address(f"{scheme}://bucket/x")
    for meant in SCHEMES:
        assert f"{meant}://bucket/x" == check_address(f"{meant}://bucket/x")
