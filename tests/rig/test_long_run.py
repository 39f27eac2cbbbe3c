"""What the bench of the long run is itself sure of."""

from tests.rig.long_run.plants import Right, complaints


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
