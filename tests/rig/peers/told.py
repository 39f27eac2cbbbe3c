"""Peers beside ours, as the plain data that the command prints.

Errors: root mean square of the reading that counts on rows that were never shown; adopted is ours;
null does not apply.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

from tests.rig.peers.judge import MODELS, OURS, Judged
from tests.rig.peers.limits import NEAR_BEST


def summary(found: Sequence[Judged]) -> dict[str, Any]:
    """Rigs on which ours is best or near it, and geometric means over rigs that have a model."""
    models = []
    for model in MODELS[2:]:
        there = [j for j in found if j.errors[model] is not None]
        means = {"over recalibrated": _mean(there, model), "ours there": _mean(there, OURS)}
        models.append({"model": model, **means, "rigs": len(there)})
    return {"best": sum(_best(j, 1.0) for j in found), "near": sum(_best(j) for j in found)} | {
        "rigs": len(found),
        "models": models,
    }


def form(found: Sequence[Judged]) -> dict[str, Any]:
    rigs = {j.rig: dataclasses.asdict(j) for j in found}
    return {"summary": summary(found), "rigs": rigs}


def _best(j: Judged, near: float = NEAR_BEST) -> bool:
    ours = j.errors[OURS]
    return ours is not None and ours <= near * min(e for e in j.errors.values() if e is not None)


def _mean(found: Sequence[Judged], model: str) -> float | None:
    """Geometric mean of errors over those of recalibration."""
    pairs = [(j.errors[model], j.errors["recalibrated"]) for j in found]
    logs = [math.log(a / b) for a, b in pairs if a and b]
    return math.exp(sum(logs) / len(logs)) if logs else None
