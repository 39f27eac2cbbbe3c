"""What begins, begins at once: an onset is searched for as a rise, and told as a step.

A search by slopes needs a rise of some samples. Where readings are many times their noise within
one, the smooth rise is itself an error of the model, and degrees make up for it.
"""

from __future__ import annotations

from dataclasses import replace

from rulec_runtime.simulation.balances import TIME

from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.search import limits
from rulec.mismatch.search.stores.searcher import Searcher


def sharpened(searcher: Searcher, best: Fitted, plain: Fitted) -> Fitted:
    """The model with onsets that take less than a sample, where that fits as well."""
    # The fixed time of an entry with an onset is what its rise is a share of.
    lengths = {
        u.id: best.values[u.id] * min(limits.SUDDEN / len(searcher.bench.time), 1.0)
        for c in best.joined
        if c.onset is not None
        for u in c.unknowns
        if u.fixed and u.driver == TIME
    }
    if not lengths:
        return best
    sharp = searcher.polished(replace(best, values={**best.values, **lengths}))
    return max(best, sharp, key=lambda f: searcher.standing(f, plain))
