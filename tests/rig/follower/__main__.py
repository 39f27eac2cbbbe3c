"""How fast rows are followed, in processor time, as JSON: `python -m tests.rig.follower`."""

import argparse
import json
import time
from collections.abc import Iterator

import numpy as np
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live import limits
from rulec_runtime.live.follower import follow
from rulec_runtime.live.memory import nothing_yet
from rulec_runtime.recordings.recording import Recording

from tests.conftest import compiled
from tests.rig.follower.plants import part_of, recorded

BLOCKS = 8
"""Of as many rows as memory has room for, in a replay."""


def costs_of(ruleset: Ruleset, recording: Recording, step: int) -> Iterator[float]:
    """Processor time of each block of rows, s: other work on the machine disturbs a clock more."""
    memory = nothing_yet(False)
    for first in range(0, len(recording), step):
        begin = time.process_time()
        for update in follow(ruleset, memory, part_of(recording, first, first + step)):
            memory = update.memory
        yield time.process_time() - begin


def replay() -> float:
    """Signal values per second of plant abc, healthy, in blocks of as many rows as memory has room
    for."""
    rows, ruleset = BLOCKS * limits.KEPT_ROWS, compiled("abc")
    recording = recorded(ruleset, rows, [], 1.0, np.random.default_rng(5))
    # The first block has no rows before it, and lays out all plans.
    _, *costs = costs_of(ruleset, recording, limits.KEPT_ROWS)
    return len(recording.values) * limits.KEPT_ROWS * (BLOCKS - 1) / sum(costs)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.rig.follower", description=__doc__)
    parser.add_argument("parts", nargs="*", choices=["replay"], default="replay")
    parser.add_argument("--json", choices=["-"], help="standard output, as without it")
    parser.parse_args()
    print(json.dumps({"replay": {"abc": {"healthy": replay()}}}, indent=1))
