"""Habits of the command line: version, help, completion, standard output, quiet, progress."""

import io
import os
import re
import shutil
import subprocess
import sys
import threading
from importlib.metadata import version
from pathlib import Path

import pytest
from rulec_runtime import limits
from rulec_runtime.cli import main as station
from rulec_runtime.output.progress import Progress
from rulec_runtime.output.terminal import Terminal

from rulec.cli import main
from tests.conftest import ROOT, SOURCES

ABC = ROOT / "plants" / "abc"
EXAMPLES = ABC / "examples"
LEAKAGE = str(EXAMPLES / "leakage_A.csv")


@pytest.mark.parametrize(("command", "name"), [(main, "rulec"), (station, "rulec-runtime")])
def test_version_and_help(command: object, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The version of the distribution; without a word the help, as wrong usage."""
    assert callable(command)
    with pytest.raises(SystemExit) as ended:
        command(["--version"])
    assert 0 == ended.value.code
    assert f"{name} {version(name)}\n" == capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        command([])
    assert 2 == ended.value.code
    assert f"usage: {name}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "options", "shown"),
    [
        (("compile", str(ABC)), ("-o",), '"format_version"'),
        (("calibrate", str(ABC), str(EXAMPLES / "calibration.csv")), ("-o",), "# Written by"),
        (("simulate", str(ABC), LEAKAGE), ("-o",), "time [s],A.n [rpm]"),
        (("diagnose", str(ABC), LEAKAGE), ("--trace", "--report"), ""),
    ],
    ids=lambda part: part[0] if isinstance(part, tuple) else "",
)
def test_a_dash_is_standard_output(
    words: tuple[str, ...],
    options: tuple[str, ...],
    shown: str,
    tmp_path: Path,
    capfdbinary: pytest.CaptureFixture[bytes],
) -> None:
    """The bytes of the file, and nothing else; the story goes to standard error, unless quiet."""
    for option in options:
        file = tmp_path / "file"
        assert 0 == main([*words, option, str(file), "-q"])
        assert (b"", b"") == capfdbinary.readouterr()
        assert 0 == main([*words, option, "-"])
        out, aside = capfdbinary.readouterr()
        both = (re.sub(rb"[-\d]+ \d\d:\d\d UTC by", b"", page) for page in (file.read_bytes(), out))
        assert 1 == len(set(both))
        assert shown.encode() in out[:200]
        assert aside


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash here")
@pytest.mark.parametrize(
    ("line", "expected"),
    [("rulec mis", {"mismatch"}), ("rulec diagnose --tr", {"--trace", "--truth"})],
)
def test_commands_and_options_are_completed(line: str, expected: set[str]) -> None:
    """What bash is told when somebody presses the tab key; nothing of the compiler is loaded."""
    environment = {
        **os.environ, "PYTHONPATH": SOURCES, "COMP_LINE": line, "COMP_POINT": str(len(line)),
        "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\013", "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
        "_ARGCOMPLETE_STDOUT_FILENAME": "/dev/stdout",
    }  # fmt: skip
    program = "import sys; sys.argv[0] = 'rulec'; from rulec.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    assert expected == set(done.stdout.split("\013"))


def test_progress_is_told_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a pipe by lines: what, how much of it, since when, how long still. On a terminal nothing
    for what is done soon, then a bar; brackets are no markup; quiet says nothing."""
    monkeypatch.setattr(limits, "LINE_EVERY", 0.001)
    monkeypatch.setattr(limits, "DRAWN_EVERY", 0.001)
    pipe, file = Watched(), Watched()
    with Progress("rulec study", "judging", console=Terminal(file=pipe, width=40)) as progress:
        progress("judging", 3, 4)
        pipe.wait_for("3 of 4")
    line = pipe.getvalue().splitlines()[-1]
    assert line.startswith("rulec study: judging 3 of 4, 0 s so far, about 0 s left")
    console = Terminal(file=file, width=100, force_terminal=True)
    with Progress("rulec mismatch", "reading", console=console):
        pass
    assert "" == file.getvalue()
    monkeypatch.setattr(limits, "SHOWN_AFTER", 0.0)
    with Progress("rulec mismatch", "reading", console=console) as progress:
        progress("trying [1/3]", 1, 3)
        file.wait_for("trying [1/3] 1 of 3")
    before = file.getvalue()
    with Progress("rulec mismatch", "reading", quiet=True, console=console):
        pass
    assert before == file.getvalue()


class Watched(io.StringIO):
    """A file that somebody waits for."""

    def __init__(self) -> None:
        super().__init__()
        self._came = threading.Condition()

    def write(self, text: str) -> int:
        with self._came:
            self._came.notify_all()
            return super().write(text)

    def wait_for(self, text: str) -> None:
        with self._came:
            assert self._came.wait_for(lambda: text in self.getvalue(), timeout=30.0)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_a_script_that_its_shell_reads(
    shell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the shell is installed, it finds no mistake in it."""
    assert 0 == main(["completion", shell])
    script = tmp_path / "script"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    assert "rulec" in script.read_text(encoding="utf-8")
    if (found := shutil.which(shell)) is not None:
        subprocess.run([found, "-n", str(script)], check=True)
