"""`rulec demo --live`: servers, watch, journal, on a short recording."""

import re
import signal
from importlib.util import find_spec

import pytest

from rulec.cli import main
from rulec.commands import demo
from rulec.demo import limits
from tests.conftest import Capsys, Patch

PLANTED = "A.leakage=0.3@20:39"


def test_a_planted_fault_is_found(capfd: Capsys, monkeypatch: Patch) -> None:
    monkeypatch.setattr(limits, "ROWS", 40)
    monkeypatch.setattr(demo, "planted", lambda: [PLANTED])
    # As in a job of CI that a shell started in the background: no Ctrl-C reaches the watch.
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert main(["demo", "--live", "--speed", "12"]) == 0
    finally:
        signal.signal(signal.SIGINT, before)
    out, _ = capfd.readouterr()
    assert "the page: http://127.0.0.1:" in out
    # How many rows tell it first is a matter of time; its bounds hold what was planted.
    began = re.search(r"began A\.leakage (\S+) \((\S+) to (\S+)\)", out)
    assert began is not None
    degree, lower, upper = map(float, began.groups())
    assert lower <= 0.3 <= upper
    assert degree == pytest.approx(0.3, abs=0.01)
    assert "Events, newest first" in out.partition("$ rulec journal")[2]
    assert "\x1b[" not in out


def test_what_is_missing_is_named(capfd: Capsys, monkeypatch: Patch) -> None:
    assert main(["demo", "--live", "--speed", "0"]) == 1
    assert "--speed 0: give a number up to 50" in capfd.readouterr().err
    here = lambda name: None if name == "asyncua" else find_spec(name)  # noqa: E731
    monkeypatch.setattr(demo, "find_spec", here)
    assert main(["demo", "--live"]) == 1
    assert "pip install 'rulec[watch]'" in capfd.readouterr().err
