"""How long looks take: processor time, which other work on the machine disturbs less than a clock.

Rows come at ten a second and wait for those before them, as on a machine that does nothing else; so
a look that takes half a second makes five rows late.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.recordings.recording import Recording

from tests.conftest import compiled
from tests.rig.follower.plants import (
    Planted,
    chain,
    part_of,
    plan_faults,
    recorded,
    side_by_side,
)

INTERVAL = 0.1
"""Seconds from row to row."""

ROWS = {"side by side": 6000, "chain": 1200}
"""Ten minutes, and two of a plant in which everything hangs together."""

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


def latencies(costs: Array) -> Array:
    """Time from a row to the end of its look, s, where rows wait for those before them."""
    done, found = 0.0, np.zeros(len(costs))
    for row, cost in enumerate(costs.tolist()):
        came = row * INTERVAL
        done = max(done, came) + cost
        found[row] = done - came
    return found


def latency(rows: int | None = None) -> dict[str, Any]:
    """From sample to event at ten rows a second, ms; `rows` in place of the usual ones."""
    found = {}
    for name, plant in PLANTS.items():
        ruleset, random = plant(), np.random.default_rng(7)
        count = rows or ROWS[name]
        planted = [*plan_faults(ruleset, count, random)]
        recording = recorded(ruleset, count, planted, INTERVAL, random)
        costs, events = np.array([*steps(ruleset, recording, 1)]).T
        late = 1e3 * latencies(costs)
        found[name] = {
            "signals": len(recording.values),
            "rows": count,
            "faults": len(planted),
            "p50": float(np.percentile(late, 50)),
            "p99": float(np.percentile(late, 99)),
            "longest": float(late.max()),
            "events_p50": float(np.percentile(late[events > 0], 50)),
            "within_100_ms": float(np.mean(late < 100.0)),
            "busy": float(costs.sum() / (count * INTERVAL)),
        }
    return found


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
