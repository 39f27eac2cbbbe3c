"""Before the first row comes: a look at readings as they should be lays out all plans."""

from __future__ import annotations

import numpy as np

from rulec_runtime import limits as common
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.live.follower import follow, nothing_yet
from rulec_runtime.live.rows import Rows


def warm_up(ruleset: Ruleset) -> None:
    """Judge as many rows at the reference point as make a settled stretch; nothing is told."""
    rows = common.SHORTEST_STRETCH
    values = {
        name: np.full(rows, ruleset.signal_by_id[name].reference) for name in ruleset.observed
    }
    for _ in follow(ruleset, nothing_yet(ruleset, False), Rows(np.arange(float(rows)), values)):
        pass
