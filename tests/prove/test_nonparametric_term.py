"""What has no name, asked at its own place: how far a better search would have come."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.recordings.recording import read_recording

from rulec.effects.model_builder import open_builder
from rulec.mismatch.evidence.steady.rows import Rows
from rulec.mismatch.search.settled.sets import with_terms
from rulec.prove.aligned import driver_of, driver_text, likeness
from rulec.prove.campaign import DRIVER
from rulec.prove.nonparametric_term import course_at
from rulec.prove.truth.sealed import Request
from rulec.prove.truth.settled.plan import Planned
from tests.runtime.mismatch.made import rows_at


def rows_in(folder: Path) -> Rows:
    """The settled points of a case that was written."""
    opened = open_builder(folder / "plant")
    return rows_at(opened, read_recording(folder / "recording.csv", opened[0]))


def test_the_course_of_a_driver_is_found_at_its_place(tmp_path: Path) -> None:
    """Nobody recorded the temperature; at another place than its own it says less."""
    name, effects = "a temperature nobody recorded", ("slip-warm",)
    made = Planned(name, "unrecorded", "dosing", "steps", effects, 3000.0, small=True).make()
    made.write(tmp_path)
    driver = made.reference(Request(())).driver
    assert driver is not None
    rows = rows_in(tmp_path)
    (planted,) = made.answer.effects
    assert course_at(tmp_path, rows, planted.places) is None
    (tmp_path / DRIVER).write_text(driver_text(*driver), encoding="utf-8")
    course = course_at(tmp_path, rows, planted.places)
    assert course is not None
    assert course > 0.9
    found = with_terms(rows, planted.places)
    assert found.nothing < 0.01
    assert all("~" in name for name in found.names)
    assert course_at(tmp_path, rows, ["nowhere.at-all"]) is None


@pytest.mark.parametrize(("sign", "noise", "least"), [(1.0, 0.0, 1.0), (-1.0, 0.1, 0.95)])
def test_the_sign_of_a_course_is_free(sign: float, noise: float, least: float) -> None:
    """A law may fall with what drives it; where there is no course there is no likeness."""
    time = np.linspace(0.0, 10.0, 50)
    driver = np.sin(time)
    clock, same = driver_of(driver_text(time, driver))
    course = sign * driver + noise * np.random.default_rng(0).standard_normal(50)
    assert likeness(time, course, clock, same) >= least - 1e-12
    assert 0.0 == likeness(time, np.full(50, np.nan), clock, same)
