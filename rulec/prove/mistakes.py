"""Mistakes: the confusion matrix of planted and reported names, and the worst cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rulec.prove.limits import WORST_CASES
from rulec.prove.results import Judged

OTHERS = ("nothing", "unnamed", "failed")
"""Answers without a name."""


@dataclass(frozen=True, kw_only=True)
class Confusion:
    """Cases with one planted effect: counts, shape (rows, columns), of planted and reported names.

    `right` counts the right answers in the same cells; `rates` are the shares of right answers by
    row, best first.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    counts: np.ndarray
    right: np.ndarray
    rates: tuple[float, ...]


def confusion(judged: Sequence[Judged]) -> Confusion:
    """Return the confusion matrix; of several reported names the first counts."""
    single = [j for j in judged if len(j.planted) == 1]
    planted = [j.planted[0] for j in single]
    said = [answer_of(j) for j in single]
    total, right = Counter(planted), dict.fromkeys(planted, 0.0)
    for j in single:
        right[j.planted[0]] += right_of(j)
    rows = sorted(total, key=lambda name: (-right[name] / total[name], name))
    # Columns follow the rows in which their names are right, so that these form a diagonal.
    named = sorted({s for s in said if s not in OTHERS})
    named.sort(key=lambda name: _main(name, single, rows))
    columns = [*named, *(o for o in OTHERS if o in said)]
    counts, rights = np.zeros((2, len(rows), len(columns)))
    for j, p, s in zip(single, planted, said, strict=True):
        counts[rows.index(p), columns.index(s)] += 1
        rights[rows.index(p), columns.index(s)] += right_of(j)
    rates = tuple(right[name] / total[name] for name in rows)
    return Confusion(
        rows=tuple(rows), columns=tuple(columns), counts=counts, right=rights, rates=rates
    )


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


def _main(name: str, judged: Sequence[Judged], rows: Sequence[str]) -> int:
    """The row in which a name is right most often; after all rows if in none."""
    right = Counter(
        rows.index(j.planted[0]) for j in judged if answer_of(j) == name and right_of(j) > 0
    )
    return right.most_common(1)[0][0] if right else len(rows)
