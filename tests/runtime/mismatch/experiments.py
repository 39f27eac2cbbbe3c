"""An experiment made by hand."""

from dataclasses import replace
from typing import Any

import numpy as np

from rulec.mismatch.experiment.result import Experiment, Reading, Step
from rulec.mismatch.result import CandidateSet


def made_by_hand() -> Experiment:
    """Two explanations; a reading that is predicted in the first of two steps, one in both."""
    rest: Any = {"joined": (), "values": {}, "fixed": {}, "periods": (), "terms": ()}
    one = CandidateSet(names=(), titles=("One",), probability=0.5, **rest)
    seen = (
        Reading("A.dp", (1e5, 2e5), 9.0, (1e3, 1e3)),
        Reading("C.dp", (1e5, 1e5), 0.0, (1.0, 1.0)),
    )
    steps = tuple(
        Step(15.0 * place, 15.0 * (place + 1), {"A.n": 10.0}, {}, readings)
        for place, readings in enumerate((seen, seen[1:]))
    )
    return Experiment(
        standing=(one, replace(one, titles=("Two",))),
        left_out=(),
        steps=steps,
        certainty=(0.5, 0.9, 0.9),
        unlisted=0.0,
        factors=np.zeros((2, 2)),
        set_by={"A.n": (5.0, 10.0)},
        present={"A.n": 5.0},
        limited=False,
        hindering=(),
        unwatched=(),
        time_is_short=False,
        sensors=(),
        sample=1.0,
    )
