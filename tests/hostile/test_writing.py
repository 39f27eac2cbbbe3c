"""Files are written as a whole or not at all, and under a name that nobody can foresee."""

from __future__ import annotations

import ast
import errno
import os
import threading
from pathlib import Path

import pytest
from rulec_runtime.output.write_file import write_text, written

from tests.conftest import ROOT

WRITER = "runtime/rulec_runtime/output/write_file.py"
SPEAKER = "runtime/rulec_runtime/output/terminal.py"
SOURCES = sorted(
    f
    for package in ("rulec", "runtime")
    for f in (ROOT / package).rglob("*.py")
    if "truth" not in f.parts  # shares no code with the tool
)


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
    """A link is replaced and not followed, rights follow the umask, a packed file has no date."""
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


def test_pipe_is_written_through(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    found: list[str] = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_text()))
    reader.start()
    write_text(pipe, "text")
    reader.join()
    assert (["text"], [pipe]) == (found, list(tmp_path.iterdir()))


def test_one_module_speaks_and_one_writes() -> None:
    """No console, `print`, markup or opened file elsewhere; templates of styles are literal."""
    for file in SOURCES:
        name = file.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
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
