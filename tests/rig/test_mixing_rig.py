"""The measuring of the rig: figures of a small run, and that the counting itself is right."""

from pathlib import Path

import pytest

from tests.rig.mixing_rig.cases import EXPERIMENTS, QUICK
from tests.rig.mixing_rig.judge import Answer, run
from tests.rig.mixing_rig.measure import FORMS, counted


def test_answers_are_counted() -> None:
    """Shares named first, and errors of those and of all that are named."""
    right, other = ("A.leakage", 0.21, 1.0), ("B.leakage", 0.3, 0.99)
    close = ("A.leakage", 0.23, 0.6)
    said = ((right,), (close, other), (other, close), (other,), ())
    found = counted([Answer("", "", 1, 0.2, {"A.leakage": 0.2}, named) for named in said])
    assert (2, 5) == (found["first"]["count"], found["first"]["of"])
    assert (0.02, 0.06) == pytest.approx((found["error"], found["error_any"]))


def test_small_faults_are_named_and_sound_plants_are_sound(tmp_path: Path) -> None:
    """Each small fault once, of which at most one may hide: it once went from 0.98 to 0.86 and
    nobody saw it. And sound samples, none called faulty."""
    start, sound = (
        FORMS[name](run(tmp_path, EXPERIMENTS[name](QUICK), workers=1))
        for name in ("sound-start", "sound")
    )
    first = start["degree"]["0.1"]["first"]
    assert 18 == first["of"]
    assert first["count"] >= 17
    assert 0 == sound["default"]["fault"]["count"]
