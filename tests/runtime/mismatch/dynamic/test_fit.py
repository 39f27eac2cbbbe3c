"""Fits of simulated recordings: what is true is found, and no more is claimed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rulec.mismatch.evidence.stores.final_fits import fixed_values, plain_end
from rulec.mismatch.evidence.stores.fit import Fitter
from rulec.mismatch.evidence.stores.locate import suspects
from rulec.mismatch.evidence.stores.noise import Noise
from rulec.mismatch.search.stores.best_set import search as searched
from rulec.mismatch.search.stores.sets import begun, grow
from tests.runtime.mismatch.dynamic.benches import (
    NOISE,
    OVERFLOW,
    RIM,
    TRUE,
    bench,
    joined_to,
    made,
)


def quiet(text: str) -> None:
    """Progress that nobody watches."""


def test_a_plain_plant_is_recalibrated_to_its_noise() -> None:
    """The error that remains is white and as large as the noise; nothing is claimed."""
    found = searched(bench(made()), quiet)
    (noise,) = found.plain.noise.values()
    assert not found.best.joined
    assert noise.spread == pytest.approx(NOISE, rel=0.1)
    assert noise.memory < 1.3


def test_zero_and_gain_of_a_sensor_are_no_physics() -> None:
    """Errors within the class of a sensor are taken out."""
    recording = made(seed=3)
    y = recording.values["lower.y"] * 1.002 + 0.02
    found = searched(bench(replace(recording, values={**recording.values, "lower.y": y})), quiet)
    assert not found.best.joined


def test_a_planted_overflow_is_fitted_to_its_truth() -> None:
    """With the overflow joined: noise remains, and the truth lies within its uncertainty."""
    place = bench(made(n=1024, seed=5, joined=(OVERFLOW,), more=RIM))
    ends, plain, found = joined_to(place, OVERFLOW, {**TRUE, **RIM})
    assert plain.noise["lower.y"].spread > 5 * NOISE
    assert found.noise["lower.y"].spread == pytest.approx(NOISE, rel=0.15)
    fitter = Fitter(place, found.joined, fixed_values(found))
    exact = fitter.with_covariance(found, replace(ends.judged, noise=found.noise))
    for name in ("l_o", "f"):
        key = f"{OVERFLOW}.{name}"
        assert abs(found.values[key] - RIM[key]) < 4.0 * exact.u(key), name


def test_a_planted_overflow_is_found() -> None:
    """Where a plant that is recalibrated makes up for much of it."""
    search = begun(bench(made(n=1024, seed=5, joined=(OVERFLOW,), more=RIM)))
    grow(search, frozenset(), {OVERFLOW})
    assert frozenset({OVERFLOW}) == search.likeliest


@pytest.mark.parametrize("spot", ["balance:upper.h", "balance:lower.h", "reading:lower.y"])
def test_the_place_of_an_error_is_found(spot: str) -> None:
    """An error that comes and goes, in a balance or a sensor: its place is suspected first."""
    size = 0.5 if spot.startswith("reading") else 2e-4
    course = size * np.sin(np.arange(1024) / 60.0) ** 3
    place = bench(made(n=1024, seed=6, errors={spot: course}))
    ends, plain = plain_end(place, {})
    sharp = replace(plain, noise={"lower.y": Noise(NOISE, 1.0)})
    assert spot == suspects(place, sharp, replace(ends.judged, noise=sharp.noise))[0].spot.id


def test_derivatives_of_the_whole_model_are_exact() -> None:
    """Slopes that the fit uses, against central differences."""
    place = bench(made(n=300))
    names = place.free(())
    values = {**place.plain_values, **TRUE}
    exact = place.simulate((), values, names).slopes["lower.y"]
    for i, name in enumerate(names):
        step = 1e-5 * abs(values[name] or 1.0)
        ends = [
            place.simulate((), {**values, name: values[name] + s}).shown["lower.y"]
            for s in (step, -step)
        ]
        numeric = (ends[0] - ends[1]) / (2 * step)
        assert np.linalg.norm(numeric - exact[:, i]) <= 1e-3 * np.linalg.norm(numeric), name
