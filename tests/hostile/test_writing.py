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


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError, OSError(errno.ENOSPC, "full")])
def test_failure_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, error: BaseException | type[BaseException]
) -> None:
    file = tmp_path / "out.csv"
    file.write_text("old")
    kind = error if isinstance(error, type) else type(error)
    with pytest.raises(kind):
        fail(file, error)
    assert [file] == list(tmp_path.iterdir())
    assert "old" == file.read_text()


def fail(file: Path, error: BaseException | type[BaseException]) -> None:
    with written(file) as out:
        out.write("new")
        raise error


def test_full_disk_is_told_of_the_file_that_was_asked_for(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="full") as caught, written(tmp_path / "out.csv"):
        raise OSError(errno.ENOSPC, "full")
    assert str(tmp_path / "out.csv") == caught.value.filename


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


def test_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    target, link = tmp_path / "precious", tmp_path / "out.txt"
    target.write_text("precious")
    link.symlink_to(target)
    write_text(link, "new")
    assert ("precious", "new", False) == (target.read_text(), link.read_text(), link.is_symlink())


def test_pipe_is_written_through(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    found: list[str] = []
    reader = threading.Thread(target=lambda: found.append(pipe.read_text()))
    reader.start()
    write_text(pipe, "text")
    reader.join()
    assert (["text"], [pipe]) == (found, list(tmp_path.iterdir()))


def test_rights_follow_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_text(tmp_path / "out.txt", "text")
    finally:
        os.umask(before)
    assert 0o640 == (tmp_path / "out.txt").stat().st_mode & 0o777


def test_packed_file_has_no_date(tmp_path: Path) -> None:
    for name in ("a.csv.gz", "b.csv.gz"):
        write_text(tmp_path / name, "text")
    assert (tmp_path / "a.csv.gz").read_bytes() == (tmp_path / "b.csv.gz").read_bytes()


@pytest.mark.parametrize("file", SOURCES, ids=lambda f: f.relative_to(ROOT).as_posix())
def test_one_module_speaks_and_one_writes(file: Path) -> None:
    """No console, `print`, markup or opened file elsewhere; templates of styles are literal."""
    name = file.relative_to(ROOT).as_posix()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        called = ast.unparse(node.func)
        last = called.rpartition(".")[2]
        if name != SPEAKER:
            assert called not in ("Console", "print", "rich.print", "sys.stderr.write"), called
            assert called not in ("sys.stdout.write", "Text.from_markup", "warnings.showwarning")
        if name != WRITER and last in ("open", "fdopen"):
            modes = [a for a in node.args if isinstance(a, ast.Constant)]
            assert not {"w", "a", "x", "+"} & set("".join(str(m.value) for m in modes[-1:])), called
        if name != WRITER:
            assert last not in ("write_bytes", "mkstemp", "NamedTemporaryFile"), called
            assert called.endswith("write_text") <= (called == "write_text"), called
        if called == "styled" and not isinstance(node.args[0], ast.Subscript):
            assert isinstance(node.args[0], ast.Constant | ast.Name), ast.unparse(node)
