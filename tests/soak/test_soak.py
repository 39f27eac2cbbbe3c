"""The soak command on a few rows: what it counts is there."""

from __future__ import annotations

from pathlib import Path

from tests.soak import mutated
from tests.soak.summary import summed


def test_mutated_rows_do_no_harm(tmp_path: Path) -> None:
    found = summed(mutated.growing_file(tmp_path, 300))
    assert found["went_on"]["count"] == found["tried"] == 300
    assert found["faults"] == 1
    assert (found["all_lost"], found["all_twice"], found["all_bad"]) == (0, 0, 0)
    assert found["shown_bytes"] > 0
