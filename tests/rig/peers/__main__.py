"""Peers beside ours on real rigs, as JSON: `python -m tests.rig.peers RIGS KEPT`.

RIGS is a folder of rigs, KEPT what `rulec prove --real RIGS --keep KEPT` left. Errors: root mean
square of the reading that counts on rows that were never shown; adopted is ours; null does not
apply.
"""

import argparse
import dataclasses
import json
import math
import sys
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from rulec.prove.campaign import CASES
from rulec.prove.real.rig_folder import rigs_in
from tests.rig.peers.case import case_of
from tests.rig.peers.judge import MODELS, OURS, Judged, judged
from tests.rig.peers.limits import NEAR_BEST

NEEDED = ("sklearn", "pysindy")


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


def _best(j: Judged, near: float = NEAR_BEST) -> bool:
    ours = j.errors[OURS]
    return ours is not None and ours <= near * min(e for e in j.errors.values() if e is not None)


def _mean(found: Sequence[Judged], model: str) -> float | None:
    """Geometric mean of errors over those of recalibration."""
    pairs = [(j.errors[model], j.errors["recalibrated"]) for j in found]
    logs = [math.log(a / b) for a, b in pairs if a and b]
    return math.exp(sum(logs) / len(logs)) if logs else None


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.rig.peers", description=__doc__)
    parser.add_argument("rigs", type=Path)
    parser.add_argument("kept", type=Path)
    parser.add_argument("--only", default="", help="rigs whose name holds this")
    options = parser.parse_args()
    lacking = [name for name in NEEDED if find_spec(name) is None]
    if lacking:
        parser.error(f"{', '.join(lacking)} not installed; pip install '.[prove]'")
    found = []
    with tempfile.TemporaryDirectory(prefix="rulec-peers-") as work:
        for number, rig in enumerate(rigs_in(options.rigs)):
            if options.only in rig.name:
                print(rig.name, file=sys.stderr)
                case = case_of(rig, options.kept / CASES / f"{number:04d}", Path(work))
                found += [] if case is None else [judged(case)]
    rigs = {j.rig: dataclasses.asdict(j) for j in found}
    print(json.dumps({"summary": summary(found), "rigs": rigs}, indent=1))


if __name__ == "__main__":
    main()
