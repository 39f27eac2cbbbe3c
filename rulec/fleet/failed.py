"""What is told of a plant-day that nobody could judge."""

from __future__ import annotations

from rulec_runtime.fleet.plant_day import Row, blank
from rulec_runtime.fleet.task import Task

from rulec.limits import FLEET_DEATHS


def died(task: Task) -> Row:
    """The row of a plant-day at which processes died."""
    reason = f"{FLEET_DEATHS} processes died at it; is there enough memory?"
    return blank(task) | {"reason": reason}
