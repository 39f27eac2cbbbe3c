"""What the bench of the long run is itself sure of."""

import numpy as np
import pytest

from tests.rig.long_run import courses
from tests.rig.long_run.plants import Right, complaints


@pytest.mark.parametrize("number", range(12))
def test_a_course_reaches_its_last_degree_when_the_recording_ends_or_before(number: int) -> None:
    course = courses.draw(number).course
    last = float(course(np.array(course.ends)))
    assert last == pytest.approx(course.last)
    assert course.begins < course.reaches(last) <= course.ends * (1.0 + 1e-4)
    assert course.reaches(1.3 * last) > course.ends


def test_an_answer_that_lacks_what_is_right_is_complained_about() -> None:
    found = {"fault": "A.leakage", "kind": "fault", "degree": 0.3, "lower": 0.2, "upper": 0.35}
    said = {
        "status": "M",
        "findings": [{**found, "probability": 1.0, "until": 9.0, "alternatives": []}],
        "unknown": [],
    }
    assert complaints(Right(faults={"A.leakage": 0.31}), said) == []
    wrong = complaints(Right(faults={"A.leakage": 0.5}), said)
    assert ["A.leakage is 0.5, told 0.3 (0.2 to 0.35)"] == wrong
    wrong = complaints(Right(sensors=("B.n.",)), said)
    assert ["nothing is told of B.n", "surely wrong: A.leakage 0.3"] == wrong
    wrong = complaints(Right(faults={"A.leakage": 0.3}, grows=True), said)
    assert "A.leakage: no course is told" in wrong
