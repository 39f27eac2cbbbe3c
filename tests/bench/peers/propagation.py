"""Beside `uncertainties` and GTC: measurement uncertainty of all residuals and degrees of abc.

Equations stand by hand in `tests/runtime/equations.py`; nothing of the compiler is in them.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bench.row import Row, median
from tests.runtime.equations import Abc
from tests.runtime.test_uncertainty import Case, case, linearisation, rule, signed_sum
from tests.runtime.test_uncertainty import with_uncertainties as by_uncertainties

SAMPLES = 16_384
KINDS = ("R:", "u:", "x:linear:", "ux:linear:")


def rows() -> list[Row]:
    """One sample as an operator would ask, and many at once as a recording has them."""
    import GTC

    with tempfile.TemporaryDirectory() as folder:
        at = case("dosing-pcp", "faulty", Path(folder))
    plan = at.ruleset.plan.select([n for n in at.ruleset.plan.outputs if n.startswith(KINDS)])
    inputs: dict[str, Any] = {**at.readings, **{f"u:{name}": u for name, u in at.u.items()}}
    inputs |= {"u:parameters": 1.0, "u:model": 1.0}
    many = inputs | {name: np.full(SAMPLES, v) for name, v in at.readings.items()}
    one = median(lambda: [plan.run(inputs) for _ in range(50)]) / 50
    each = median(lambda: plan.run(many)) / SAMPLES

    def by_gtc(at: Case) -> dict[str, Any]:
        values = {name: GTC.ureal(v, at.u[name]) for name, v in at.readings.items()}
        return values | {n: GTC.ureal(v, u) if u else v for n, (v, u) in at.parameters().items()}

    found = []
    for key, peer, numbers, u_of in (
        ("uncertainties", "uncertainties", by_uncertainties, lambda x: x.std_dev),
        ("gtc", "GTC", by_gtc, GTC.uncertainty),
    ):
        _checked(at, numbers, u_of)
        theirs = median(lambda numbers=numbers, u_of=u_of: evaluated(at, numbers, u_of), 3)
        same = "residuals, degrees and their uncertainties from raw inputs; agree to 1e-8"
        for more, what, ours in (
            ("", f"uncertainty in a block of {SAMPLES:,} samples, per sample", each),
            ("-one", "uncertainty of one sample alone", one),
        ):
            differs = (
                "equations by hand there, every sample anew, derivatives found on the way"
                if not more
                else "the same; here an interpreted plan on arrays of length 1"
            )
            found.append(
                Row(
                    key=key + more,
                    what=what,
                    peer=peer,
                    ours=ours,
                    theirs=theirs,
                    same=same,
                    differs=differs,
                )
            )
    return found


def evaluated(
    at: Case, numbers: Callable[[Case], dict[str, Any]], u_of: Callable[[Any], float]
) -> dict[str, float]:
    """Standard uncertainties of all residuals and linear degrees of a sample, by name."""
    system = Abc(at.kinds(), numbers(at))
    residuals, observers = {r.id: r for r in at.ruleset.residuals}, system.observers()
    found = {f"u:{name}": u_of(signed_sum(r, observers)) for name, r in residuals.items()}
    for cell in at.ruleset.cells:
        name = f"ux:linear:{cell.fault}:{cell.residual}"
        found[name] = u_of(rule(system, residuals[cell.residual], cell.fault))
    return found


def _checked(
    at: Case, numbers: Callable[[Case], dict[str, Any]], u_of: Callable[[Any], float]
) -> None:
    """Ours has one part more, how far the linear rule itself is off."""
    ours, theirs = at.results(), evaluated(at, numbers, u_of)
    residuals = {r.id: r for r in at.ruleset.residuals}
    for residual in residuals:
        assert theirs[f"u:{residual}"] == pytest.approx(ours[f"u:{residual}"], rel=1e-8)
    for cell in at.ruleset.cells:
        name = f"ux:linear:{cell.fault}:{cell.residual}"
        whole = np.hypot(theirs[name], linearisation(at, cell, residuals[cell.residual]))
        assert whole == pytest.approx(ours[name], rel=1e-8), name
