"""A fault that comes and goes with what is set is no fault."""

from __future__ import annotations

import numpy as np
import pytest

from rulec.mismatch.evidence.steady.configuration import Course, Span
from rulec.mismatch.evidence.steady.fit import Fitted
from rulec.mismatch.evidence.steady.screen import InitialCandidate
from rulec.mismatch.search import coincide
from rulec.mismatch.search.coincide import with_settings
from tests.runtime.mismatch.made import alone
from tests.runtime.mismatch.test_screen import plain


def coming(fitted: Fitted, there: np.ndarray) -> InitialCandidate:
    """A leakage that is there at some points."""
    candidate = next(c for c in alone()[1].candidates if c.id == "A.leakage")
    segment = np.where(there, 0, -1)
    spans = (Span(0.0, 1.0, 0), Span(2.0, 3.0, 0))
    course = Course(candidate.unknowns[0].id, segment, spans)
    return InitialCandidate(
        candidate=candidate,
        values=dict.fromkeys(course.names(), 0.1),
        fixed={},
        gain=1.0,
        course=course,
    )


def test_points_that_say_nothing_of_a_fault_do_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line may stand still for half of the time: whether it is clogged then, nobody sees."""
    fitted = plain("healthy")
    speed = fitted.rows.system.data.values["A.n"]
    fast, seen = speed > np.median(speed), np.arange(len(speed)) % 48 < 24
    guessed = np.where(seen, fast, np.arange(len(speed)) % 96 < 48)
    assert with_settings(fitted, coming(fitted, fast))
    assert not with_settings(fitted, coming(fitted, guessed))
    monkeypatch.setattr(coincide, "speaking", lambda fitted, candidate: seen)
    assert with_settings(fitted, coming(fitted, guessed))


def test_a_fault_of_its_own_time_does_not_follow() -> None:
    """It lasts for a while, whatever is set."""
    fitted = plain("healthy")
    number = np.arange(len(fitted.used))
    assert not with_settings(fitted, coming(fitted, (number % 100 > 30) & (number % 100 < 70)))
