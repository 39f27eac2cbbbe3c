"""The soak command on a few rows: what it counts is there."""

from pathlib import Path

from tests.soak.__main__ import growing_file
from tests.soak.watching import summed


def test_mutated_rows_do_no_harm(tmp_path: Path) -> None:
    found = summed(growing_file(tmp_path, 100))
    assert found["went_on"]["count"] == found["tried"] == 100
    assert found["faults"] == 1
    assert (found["all_lost"], found["all_twice"], found["all_bad"]) == (0, 0, 0)
    assert found["shown_bytes"] > 0
