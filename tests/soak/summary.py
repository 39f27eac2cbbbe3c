"""What all parts have in common: went on, lost, told twice, and what nobody may ever see."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tests.figures.share import Share

LOST = ("numbers_lost", "rows_lost", "lost", "faults_lost", "episodes_without_end")
TWICE = ("numbers_twice", "rows_twice", "twice", "faults_twice", "episodes_ended_twice")
BAD = ("tracebacks", "steering")


def summed(form: Mapping[str, Any]) -> dict[str, Any]:
    """The form with these; as it is where the part was skipped."""
    if "skipped" in form:
        return dict(form)
    return {
        **form,
        "went_on": Share(form["survived"], form["tried"]).form(),
        "all_lost": sum(form.get(name, 0) for name in LOST),
        "all_twice": sum(form.get(name, 0) for name in TWICE),
        "all_bad": sum(form.get(name, 0) for name in BAD),
    }
