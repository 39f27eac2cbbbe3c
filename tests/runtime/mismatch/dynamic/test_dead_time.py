"""What arrives later: a state with a dead time against the same plant, run that much earlier."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.recording import Recording

from tests.runtime.mismatch.dynamic.benches import STEP, TRUE, bench, made, tanks

PUMP = "pump.transport-delay@pump"
TAU = f"{PUMP}.tau"


@functools.cache
def recording() -> Recording:
    """Of the plain plant."""
    return made()


def shown(joined: tuple[str, ...], tau: float = 0.0) -> Array:
    """Level of the lower tank, V."""
    return bench(recording()).simulate(joined, {**TRUE, TAU: tau}).shown["lower.y"]


@pytest.mark.parametrize("samples", [5, 25])
def test_a_dead_time_shifts(samples: int) -> None:
    """After what began before the recording is forgotten, the level is the same, only later."""
    plain, late = shown(()), shown((PUMP,), samples * STEP)
    forgotten = 150
    error = late[forgotten + samples :] - plain[forgotten : len(plain) - samples]
    assert np.abs(error).max() < 0.01 * np.std(plain)


def test_no_dead_time_is_no_change() -> None:
    """At its null the plain plant comes back, but for what a sample resolves."""
    assert np.abs(shown((PUMP,), 0.0) - shown(())).max() < 0.02 * np.std(shown(()))


@pytest.mark.parametrize("name", [TAU, "upper.a", "pump.k"])
def test_slopes_are_those_of_finite_differences(name: str) -> None:
    """Slopes are carried through the past; the dead time is off the kinks between samples."""
    values, bench_ = {**TRUE, TAU: 5.4 * STEP}, bench(recording())
    step = 1e-4 * values[name]
    below, above = (
        bench_.simulate((PUMP,), {**values, name: values[name] + side * step}).shown["lower.y"]
        for side in (-1.0, 1.0)
    )
    slopes = bench_.simulate((PUMP,), values, (name,)).slopes["lower.y"][:, 0]
    difference = (above - below) / (2.0 * step)
    within = (below < 9.9) & (above < 9.9)  # the sensor's range ends at 10 V
    assert np.abs(slopes - difference)[within].max() < 1e-3 * np.abs(difference).max()


def test_it_is_told_as_a_dead_time() -> None:
    """The equation that is stored says when what it follows arrives."""
    _, builder = tanks()
    assert any(name.startswith("after:") for name in builder.balances((PUMP,)).plan.outputs)
