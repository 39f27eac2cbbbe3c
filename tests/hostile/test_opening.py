"""One module opens what somebody gave, and decides what may be opened; one writes: whole files or
none, under a name that nobody can foresee."""

import ast
import contextlib
import errno
import functools
import io
import os
import socket
import threading
from pathlib import Path

import pytest
from rulec_runtime.output import open_file
from rulec_runtime.output.open_file import FOLDERS, SCHEMES, begin_of, check_address, is_near
from rulec_runtime.output.refusal import Refusal
from rulec_runtime.output.write_file import write_text, written
from rulec_runtime.recordings import formats, limits

from tests.conftest import ROOT

WRITER = "runtime/rulec_runtime/output/write_file.py"
SPEAKER = "runtime/rulec_runtime/output/terminal.py"
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
    "rulec/fleet/store.py": "its own files, and to write them",
    "rulec/fleet/plant_days.py": "an address that was checked",
    "runtime/rulec_runtime/fleet/plant_day.py": "an address that was checked",
    "rulec/mtp/caex.py": "bytes that were read",
    "runtime/rulec_runtime/live/state.py": "bytes that were read",
    "runtime/rulec_runtime/recordings/text_file.py": "a file that is open",
    "runtime/rulec_runtime/live/journal/database.py": "a file that was looked into",
    "runtime/rulec_runtime/live/journal/mqtt_out.py": "a file that was looked into",
    "runtime/rulec_runtime/live/sources/mqtt.py": "files that were found to be regular",
    "runtime/rulec_runtime/commands/frame.py": "the null device",
    "runtime/rulec_runtime/live/journal/watcher.py": "what the system says of itself",
    "runtime/rulec_runtime/live/view/live_screen.py": "the terminal",
    "runtime/rulec_runtime/output/append_file.py": "to append; it looks for itself",
    "runtime/rulec_runtime/output/write_file.py": "to write",
}
"""Who else opens something, and what."""

FOLDERS_BESIDE = {
    "rulec/prove/": "cases and answers that the proof wrote itself",
    "runtime/rulec_runtime/recordings/readers/": "a file that is open",
}


@functools.cache
def calls() -> list[tuple[str, ast.Call, str]]:
    """Each call of the tool: its file, itself, and what is called."""
    files = (f for package in ("rulec", "runtime") for f in (ROOT / package).rglob("*.py"))
    return [
        (file.relative_to(ROOT).as_posix(), node, ast.unparse(node.func))
        for file in files
        if "truth" not in file.parts  # shares no code with the tool
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
    ]


def test_nobody_opens_beside_it() -> None:
    """Whoever does stands in the list, with what it opens."""
    found = {
        file
        for file, _, called in calls()
        if OPENS & {called, called.rpartition(".")[2]} and "__file__" not in called
    }
    assert {*BESIDE, OPENER} == {f for f in found if not f.startswith(tuple(FOLDERS_BESIDE))}


def test_regular_files_alone_are_opened(tmp_path: Path) -> None:
    """Links to them, too; sizes are looked at before anything is read."""
    (tmp_path / "file").write_bytes(b"\xef\xbb\xbf1\r\n")
    (tmp_path / "link").symlink_to("file")
    assert "1\n" == open_file.text_of(tmp_path / "link", 6)
    assert b"\xef" == begin_of(tmp_path / "file", 1)
    with pytest.raises(OSError, match="more than 0 MB"):
        open_file.bytes_of(tmp_path / "file", 5)
    with (tmp_path / "large").open("wb") as file:
        file.truncate(2**40)
    os.mkfifo(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(tmp_path / "socket"))
    (tmp_path / "away").symlink_to("pipe")
    for name in ("large", "pipe", "socket", "away", ".", "/dev/zero", "/dev/tty", "none"):
        with pytest.raises(OSError, match=r"this is no file but|it has more|No such"):
            open_file.opened(tmp_path / name)


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


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.ENOSPC, "full")])
def test_failure_leaves_the_old_file_and_nothing_else(tmp_path: Path, error: BaseException) -> None:
    """A full disk is told of the file that was asked for."""
    file = tmp_path / "out.csv"
    file.write_text("old")
    with pytest.raises(type(error)) as caught:
        fail(file, error)
    assert str(file) == getattr(caught.value, "filename", str(file))
    assert [file] == list(tmp_path.iterdir())
    assert "old" == file.read_text()


def fail(file: Path, error: BaseException) -> None:
    with written(file) as out:
        out.write("new")
        raise error


def test_two_writers_never_mix(tmp_path: Path) -> None:
    """Every read is the whole text of one of them."""
    file = tmp_path / "out.txt"
    texts = ["a" * 50_000, "b" * 50_000]
    write_text(file, texts[0])
    threads = [
        threading.Thread(target=lambda text=text: [write_text(file, text) for _ in range(100)])
        for text in texts
    ]
    for thread in threads:
        thread.start()
    seen = {file.read_text() for _ in range(200)}
    for thread in threads:
        thread.join()
    assert seen <= set(texts)
    assert [file] == list(tmp_path.iterdir())


def test_how_a_file_is_left(tmp_path: Path) -> None:
    """A link is replaced and not followed, rights follow the umask, a packed file has no date, a
    pipe is written through."""
    target, link = tmp_path / "precious", tmp_path / "out.txt"
    target.write_text("precious")
    link.symlink_to(target)
    before = os.umask(0o027)
    try:
        write_text(link, "new")
    finally:
        os.umask(before)
    assert ("precious", "new", False) == (target.read_text(), link.read_text(), link.is_symlink())
    assert 0o640 == link.stat().st_mode & 0o777
    for name in ("a.csv.gz", "b.csv.gz"):
        write_text(tmp_path / name, "text")
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    found: list[str] = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_text()))
    reader.start()
    write_text(pipe, "text")
    reader.join()
    assert (["text"], True) == (found, pipe.is_fifo())
    assert ["a.csv.gz", "b.csv.gz", "out.txt", "pipe", "precious"] == sorted(os.listdir(tmp_path))


def test_one_module_speaks_and_one_writes() -> None:
    """No console, `print`, markup or opened file elsewhere; templates of styles are literal."""
    for name, node, called in calls():
        assert name == SPEAKER or called not in SPEAKS, (name, called)
        assert name == WRITER or not writes(node, called), (name, called)
        if called == "styled" and not isinstance(node.args[0], ast.Subscript):
            assert isinstance(node.args[0], ast.Constant | ast.Name), name


SPEAKS = {"Console", "print", "rich.print", "sys.stderr.write", "sys.stdout.write"}
SPEAKS |= {"Text.from_markup", "warnings.showwarning"}


def writes(node: ast.Call, called: str) -> bool:
    """Does a call write a file by itself?"""
    last = called.rpartition(".")[2]
    if last in ("open", "fdopen"):
        modes = [str(a.value) for a in node.args if isinstance(a, ast.Constant)]
        return bool({"w", "a", "x", "+"} & set("".join(modes[-1:])))
    own = called.endswith("write_text") and called != "write_text"
    return own or last in ("write_bytes", "mkstemp", "NamedTemporaryFile")
