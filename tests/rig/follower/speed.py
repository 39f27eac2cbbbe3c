"""How long rows take, in processor time: other work on the machine disturbs a clock more."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.recordings.recording import Recording

from tests.conftest import compiled
from tests.rig.follower.plants import Planted, chain, part_of, recorded, side_by_side
from tests.rig.follower.two_cores import INTERVAL, Run, followed

ROWS = 1800
"""Three minutes."""

SPANS = {"start": (0, 900), "later": (600, ROWS)}
"""Rows of the first minute and a half, and those behind the first minute."""

BEGINS = 300
"""Row with which a fault begins that lasts."""

LASTING = {"side by side": "L3A.leakage", "chain": "M6P2.leakage"}

BLOCKS = 8
"""Of as many rows as memory has room for, in a replay."""

PLANTS: dict[str, Callable[[], Ruleset]] = {"side by side": side_by_side, "chain": chain}


def steps(ruleset: Ruleset, recording: Recording, step: int) -> Iterator[tuple[float, int]]:
    """Processor time of each block of rows, s, and how many events it told."""
    memory = nothing_yet(ruleset, False)
    for first in range(0, len(recording), step):
        begin, events = time.process_time(), 0
        for told in follow(ruleset, memory, part_of(recording, first, first + step)):
            memory, events = told.memory, events + len(told.events)
        yield time.process_time() - begin, events


def latency() -> dict[str, Any]:
    """From sample to event at ten rows a second, ms, without a fault and with one that lasts."""
    found: dict[str, Any] = {}
    for name, plant in PLANTS.items():
        ruleset = plant()
        lasting = [Planted(LASTING[name], 0.3, BEGINS, ROWS)]
        for kind, planted in (("healthy", []), ("faulty", lasting)):
            recording = recorded(ruleset, ROWS, planted, INTERVAL, np.random.default_rng(7))
            form: dict[str, Any] = {"signals": len(recording.values), "rows": ROWS}
            run = followed(ruleset, recording)
            form |= {name: of_rows(run, *part) for name, part in SPANS.items()}
            form |= {"looks": len(run.looks), "longest_look": max(run.looks, default=0.0)}
            form |= {"busy": run.busy, "busy_beside": sum(run.looks) / (ROWS * INTERVAL)}
            found.setdefault(name, {})[kind] = form
    return found


def of_rows(run: Run, first: int, last: int) -> dict[str, float]:
    """Of some of the rows: how late they were judged, ms."""
    late, told_of = 1e3 * run.late[first:last], run.told_of[first:last]
    return {
        "p50": float(np.percentile(late, 50)),
        "p99": float(np.percentile(late, 99)),
        "longest": float(late.max()),
        "events": float(late[told_of].max(initial=0.0)),
        "within_100_ms": float(np.mean(late < 100.0)),
    }


def replay() -> dict[str, Any]:
    """Signal values per second, in blocks of as many rows as memory has room for."""
    rows = BLOCKS * limits.KEPT_ROWS
    found: dict[str, Any] = {}
    for name, ruleset, fault in (
        ("abc", compiled("abc"), "A.leakage"),
        ("side by side", side_by_side(), "L3A.leakage"),
    ):
        lasting = [Planted(fault, 0.3, rows // 4, rows)]
        for kind, planted in (("healthy", []), ("faulty", lasting)):
            recording = recorded(ruleset, rows, planted, 1.0, np.random.default_rng(5))
            costs = np.array([cost for cost, _ in steps(ruleset, recording, limits.KEPT_ROWS)])
            # The first block has no rows before it, and lays out all plans.
            values = len(recording.values) * limits.KEPT_ROWS * (BLOCKS - 1)
            found.setdefault(name, {})[kind] = values / float(costs[1:].sum())
    return found
