"""What an explanation costs before any data, in log odds."""

from __future__ import annotations

import numpy as np

from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.search import limits


def price_of(fitted: Fitted, news: float) -> float:
    """Half the logarithm of the news for each value found, and how rare each sort is.

    Source: Schwarz 1978.
    """
    each = 0.5 * float(np.log(max(news, 2.0)))
    count = sum(not u.fixed for c in fitted.joined for u in c.unknowns)
    rare = sum(limits.RARITY[c.sort] + (limits.COMMON if c.members else 0.0) for c in fitted.joined)
    return each * count + rare


def needed(tried: int) -> float:
    """Gain that is worth naming."""
    return limits.NEEDED_OVER_TIME + float(np.log(max(tried, 1)))
