"""Judge plant-days, on any engine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from rulec_runtime.fleet.plant_day import Row, Task, blank, judge_day

from rulec.engines.call import Call, Engine
from rulec.engines.engine import run
from rulec.limits import WORKER_DEATHS


def judged(
    engine: Engine, tasks: Sequence[Task], rulesets: Mapping[str, str]
) -> Iterator[tuple[Task, Row]]:
    """Rows as they are done; `rulesets` are texts by hash.

    If processes die repeatedly at a plant-day, its row says so.
    """

    def died(number: int) -> Row:
        reason = f"{WORKER_DEATHS} processes died at it; is there enough memory?"
        return blank(tasks[number]) | {"reason": reason}

    calls = [Call((task,), task.ruleset) for task in tasks]
    for number, row in run(engine, judge_day, calls, rulesets, died):
        yield tasks[number], row
