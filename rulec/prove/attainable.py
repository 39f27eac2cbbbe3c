"""The best possible analysis: the share of names that the readings determine.

The best analyst knows every law but its size (of a law with a form error, how large that may be),
all noise and all possible effects, and compares log likelihoods of the samples that are not held
out. That of the true model exceeds that of the plain one by a normal number with mean G and
variance 2 G, and that of the nearest other law by one with mean M and variance 2 M (G and M:
strength and margin of a case, as far as those samples determine them). The analyst claims an effect
at a gain that clean recordings seldom show.

Source: normal linear models; Bonferroni's inequality for the claim.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist

from rulec.prove.limits import CLAIMED, LOOKED_AT
from rulec.prove.results import Judged

NORMAL = NormalDist()


def claimed(strength: float) -> float:
    """Return the probability that an effect is claimed."""
    gain = LOOKED_AT * strength
    if math.isinf(gain):
        return 1.0
    return NORMAL.cdf((gain - CLAIMED) / math.sqrt(2.0 * gain)) if gain > 0.0 else 0.0


def named(strength: float, margin: float) -> float:
    """Return the probability that it is claimed by its own name."""
    lead = LOOKED_AT * max(margin, 0.0)
    return claimed(strength) * (1.0 if math.isinf(lead) else NORMAL.cdf(math.sqrt(lead / 2.0)))


def at_best(judged: Sequence[Judged]) -> tuple[float, float] | None:
    """Return the mean share of places, and of names; None if either has no case."""
    known = [j for j in judged if not (j.clean or math.isnan(j.gain) or math.isnan(j.margin))]
    placed = [claimed(j.gain) for j in known if j.place_right is not None]
    names = [named(j.gain, j.margin) for j in known if j.name_right is not None]
    if not placed or not names:
        return None
    return sum(placed) / len(placed), sum(names) / len(names)


def at_best_words(judged: Sequence[Judged]) -> str:
    """Return the same in one sentence; empty without cases."""
    if (found := at_best(judged)) is None:
        return ""
    place, name = (f"{100.0 * share:.0f} %" for share in found)
    return (
        f"at best {place} of places and {name} of names: so much the four fifths of the readings "
        "hold that may be looked at, for whoever knows every law and all noise"
    )
