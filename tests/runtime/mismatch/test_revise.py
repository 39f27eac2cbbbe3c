"""Looking back at what was accepted."""

from __future__ import annotations

import pytest

from rulec.mismatch.search import revise
from rulec.mismatch.search.revise import needless
from tests.runtime.mismatch.warm import SLIP, after


def test_what_is_needed_stays() -> None:
    """Slip that follows the temperature is not explained by anything else."""
    now = after()
    assert needless(now, [SLIP]) == (now, [])


def test_what_nothing_needs_is_left_out() -> None:
    """A law in the model of a healthy recording."""
    less, gone = needless(after(warm=False), [SLIP])
    assert gone == [SLIP]
    assert less.fitted.setting.joined == ()


def test_nothing_is_needless_where_what_is_left_runs_to_an_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a real pump a law of friction gave way to a meter that reads nothing at all."""
    monkeypatch.setattr(revise, "at_an_end", lambda model, *laws: not laws)
    now = after(warm=False)
    assert needless(now, [SLIP]) == (now, [])
