"""A rim that liquid runs over: steep laws that begin at a level which no sample shows."""

from __future__ import annotations

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array

from rulec.mismatch.evidence.stores.final_fits import fixed_values
from rulec.mismatch.evidence.stores.fit import Fitter
from rulec.mismatch.evidence.stores.model import model_of
from rulec.mismatch.inference.interval import profile
from tests.runtime.mismatch.dynamic.benches import (
    OVERFLOW,
    RIM,
    STEP,
    TRUE,
    bench,
    joined_to,
    made,
    tanks,
    voltage,
)


def shown(sharpness: float, parts: int) -> Array:
    """Reading of the lower tank, with samples cut in parts; V."""
    builder = tanks()[1]
    balances = builder.balances((OVERFLOW,))
    u = np.repeat(voltage(512, 3), parts)
    values = dict(zip(builder.parameters.ids, builder.parameters.values, strict=True))
    values |= {**builder.parameters.constants, **TRUE, **RIM, f"{OVERFLOW}.k": sharpness}
    course = balances.run(STEP / parts * np.arange(len(u)), u[:, None], np.array([True]), values)
    return np.asarray(course.shown[::parts, balances.outputs.index("shown:lower.y")])


@pytest.mark.parametrize("sharpness", [60.0, 300.0, 1000.0])
def test_a_rim_is_seen_within_a_sample(sharpness: float) -> None:
    """A level that shoots over its rim within one step would come down as a flood."""
    error = shown(sharpness, 1) - shown(sharpness, 16)
    assert float(np.sqrt(np.mean(error**2))) < 0.002
    assert float(np.abs(error).max()) < 0.02


def test_what_only_a_prior_tells_is_as_uncertain_as_the_prior() -> None:
    """All levels of an unmeasured tank could be larger: flows, outlets and gain go with them."""
    place = bench(made(n=512, seed=6, joined=(OVERFLOW,), more=RIM))
    ends, _, found = joined_to(place, OVERFLOW, {**TRUE, **RIM})
    found = Fitter(place, found.joined, fixed_values(found)).with_covariance(found, ends.judged)
    model = model_of(place, found, ends.judged, fixed_values(found))
    low, high = profile(model.line(f"{OVERFLOW}.l_o"))
    assert low < RIM[f"{OVERFLOW}.l_o"] < high
    assert high - low > 0.3 * RIM[f"{OVERFLOW}.l_o"]
    low, high = profile(model.line(f"{OVERFLOW}.f"))
    assert low < RIM[f"{OVERFLOW}.f"] < high
    assert high - low < 0.1
