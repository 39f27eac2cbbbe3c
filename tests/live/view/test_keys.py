"""Keys of a terminal, and the terminal as it was afterwards."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
import termios
import time
from collections.abc import Iterator

import pytest
from rulec_runtime.live.view.keys import Keys

from tests.conftest import ROOT, SOURCES


@pytest.fixture
def ends() -> Iterator[tuple[int, int]]:
    """Both ends of a terminal."""
    ours, theirs = pty.openpty()
    yield ours, theirs
    for end in (ours, theirs):
        try:
            os.close(end)
        except OSError:
            continue


@pytest.mark.parametrize(
    ("sent", "keys"),
    [
        (b"\x1b[A\x1b[B\x1bOA\x1bOBkj", ["up", "down"] * 2 + ["up", "down"]),
        (b"\rap?q", ["enter", "acknowledge", "past", "help", "quit"]),
        (b"\x1b[15~\x1b[1;5C\x1b[3~z\xff\xc3\xa9", []),
        (b"\x1b[<0;1;1Mq", ["quit"]),
        (b"", []),
    ],
)
def test_keys_have_names(ends: tuple[int, int], sent: bytes, keys: list[str]) -> None:
    with Keys(ends[1]) as pressed:
        os.write(ends[0], sent)
        assert keys == pressed.take(0.05)


def test_sequence_in_two_parts_is_one_key_and_escape_alone_goes_back(
    ends: tuple[int, int],
) -> None:
    with Keys(ends[1]) as pressed:
        os.write(ends[0], b"\x1b")
        assert [] == pressed.take(0.05)
        os.write(ends[0], b"[A")
        assert ["up"] == pressed.take(0.05)
        os.write(ends[0], b"\x1b")
        assert [[], ["back"]] == [pressed.take(0.05), pressed.take(0.01)]


def test_terminal_is_given_back(ends: tuple[int, int]) -> None:
    before = termios.tcgetattr(ends[1])
    with Keys(ends[1]):
        during = termios.tcgetattr(ends[1])
    assert not during[3] & (termios.ICANON | termios.ECHO)
    assert during[3] & termios.ISIG
    assert before == termios.tcgetattr(ends[1])
    with pytest.raises(ValueError, match="odd"), Keys(ends[1]):
        raise ValueError("odd")
    assert before == termios.tcgetattr(ends[1])


def test_terminal_that_goes_away_leaves_no_keys(ends: tuple[int, int]) -> None:
    with Keys(ends[1]) as pressed:
        os.close(ends[0])
        assert [] == pressed.take(0.05)
        assert not pressed.there
        since = time.monotonic()
        assert [] == pressed.take(0.02)
        assert time.monotonic() - since >= 0.02


def test_no_terminal_no_keys() -> None:
    program = (
        "from rulec_runtime.live.view.keys import Keys\n"
        "with Keys() as keys: print(keys.there, keys.take(0.01))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": SOURCES},
        start_new_session=True,
        check=True,
    )
    assert "False []\n" == done.stdout
