"""Which models are carried along, and with what each of them is tried next."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rulec.effects.candidate import Candidate
from rulec.mismatch.evidence.stores.fit import Fitted
from rulec.mismatch.search import limits

Task = tuple[Fitted, tuple[Candidate, ...]]
"""A fitted model, and what is joined instead."""


def swaps_of(model: Fitted, candidates: Sequence[Candidate]) -> list[Task]:
    """A model with each of its explanations exchanged for each other candidate."""
    tasks = []
    for left in model.joined:
        rest = tuple(c for c in model.joined if c.id != left.id)
        values = {n: v for n, v in model.values.items() if not n.startswith(f"{left.id}.")}
        bare = replace(model, joined=rest, values=values)
        tasks += in_place_of(left, bare, candidates)
    return tasks


def in_place_of(left: Candidate, bare: Fitted, candidates: Sequence[Candidate]) -> list[Task]:
    """A model without one explanation, with each other candidate that acts in single modules."""
    new = (c for c in candidates if not c.members and c.id not in (*bare.ids, left.id))
    return [(bare, (*bare.joined, c)) for c in new if not _twice(bare, c)]


def tasks_of(models: Sequence[Fitted], candidates: Sequence[Candidate]) -> list[Task]:
    """Each model with each further candidate; the same set once."""
    seen: set[frozenset[str]] = set()
    tasks = []
    for model in models:
        for candidate in candidates:
            ids = frozenset({*model.ids, candidate.id})
            if candidate.id in model.ids or ids in seen or _twice(model, candidate):
                continue
            seen.add(ids)
            tasks.append((model, (*model.joined, candidate)))
    return tasks


def _twice(model: Fitted, candidate: Candidate) -> bool:
    """Is an explanation of this name at this place in the model, alone or with others?"""
    return any(
        c.name == candidate.name
        and c.place == candidate.place
        and set(c.modules) & set(candidate.modules)
        for c in model.joined
    )


def distinct(ranked: Sequence[Fitted]) -> list[Fitted]:
    """The best ones, of which few share any explanation: their kin would crowd out the rest.

    Of twins, which say the same in other words, one is carried along; others in its place are
    weighed in the end.
    """
    kept: list[Fitted] = []
    count: Counter[str] = Counter()
    for fitted in ranked:
        if len(kept) == limits.BEAM:
            break
        if any(are_twins(fitted, other) for other in kept):
            continue
        if max((count[i] for i in fitted.ids), default=0) < limits.SHARING:
            kept.append(fitted)
            count.update(fitted.ids)
    return kept


def are_twins(one: Fitted, other: Fitted) -> bool:
    """Do two models leave the same errors?"""
    if len(one.joined) != len(other.joined):
        return False
    pairs = ((one.errors[n], other.errors[n], noise.spread) for n, noise in one.noise.items())
    return all(
        np.sqrt(np.nanmean((a - b) ** 2)) < limits.EQUIVALENT * spread for a, b, spread in pairs
    )
