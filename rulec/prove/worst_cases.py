"""The worst cases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rulec.prove.limits import WORST_CASES
from rulec.prove.results import Judged


def answer_of(judged: Judged) -> str:
    """Return the answer in one word."""
    if judged.error:
        return "failed"
    if judged.said:
        return judged.said[0].partition("@")[0]
    return "unnamed" if judged.verdict == "unnamed" else "nothing"


def right_of(judged: Judged) -> float:
    """Return the score of the name; of an effect without an entry, that of `unnamed`."""
    scores = (judged.name_right, judged.unnamed_right)
    return float(next((s for s in scores if s is not None), 0.0))


@dataclass(frozen=True)
class Bad:
    """A case that went wrong, and why."""

    judged: Judged
    why: str


def worst(judged: Sequence[Judged], count: int = WORST_CASES) -> list[Bad]:
    """Return certain mistakes first, then false claims on clean cases, no answer, missed effects.

    Within each kind the strongest effect comes first.
    """
    ranked = [(rank, j, why) for j in judged for rank, why in [_sort(j)] if why]
    ranked.sort(key=lambda r: (r[0], -np.nan_to_num(r[1].gain), r[1].case))
    return [Bad(j, why) for _, j, why in ranked[:count]]


def _sort(judged: Judged) -> tuple[int, str]:
    """Rank of the kind of mistake, and its reason; an empty text if nothing is wrong."""
    certain = judged.said and judged.verdict in ("named", "fault", "sensor")
    if judged.error:
        return 2, f"no answer: {judged.error}"
    if not judged.clean and certain and right_of(judged) == 0:
        wrong = judged.told_right is False
        return 0, "wrong and certain" + (", of another sort" if wrong else "")
    if judged.clean:
        return 1, "" if judged.clean_right in (None, 1) else "false claim on a clean recording"
    if right_of(judged) == 0:
        return 3, "missed"
    if judged.place_right == 0:
        return 4, "named at a wrong place"
    return 5, "named only in part" if right_of(judged) < 1 else ""
