"""Simulated tanks: exact slopes, delays, rims, ends of what a sensor says; and fits with them."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.simulation.balances import RanAway

from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.stores.fit import Fitter, fixed_values, plain_end
from rulec.mismatch.evidence.stores.model import model_of
from rulec.mismatch.evidence.stores.simulation_problem import SimulationProblem
from rulec.mismatch.inference.prove import profile
from tests.runtime.mismatch.dynamic.benches import (
    NOISE,
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
from tests.runtime.mismatch.made import changed

LATE = "pump.transport-delay@pump"
TAU = f"{LATE}.tau"
FORGOTTEN = 150
"""Samples after which what began before the recording does not matter."""


@functools.cache
def plain() -> SimulationProblem:
    return bench(made())


def shown(tau: float | None = None, **moved: float) -> Array:
    """Level of the lower tank, V, with a dead time if there is one."""
    joined, values = ((), TRUE) if tau is None else ((LATE,), {**TRUE, TAU: tau})
    return np.asarray(plain().simulate(joined, {**values, **moved}).shown["lower.y"])


@pytest.mark.parametrize(("samples", "off"), [(0, 0.02), (5, 0.01), (25, 0.01)])
def test_a_dead_time_shifts(samples: int, off: float) -> None:
    late, first = shown(samples * STEP), FORGOTTEN if samples else 0
    error = late[first + samples :] - shown()[first : len(late) - samples]
    assert np.abs(error).max() < off * np.std(shown())


@pytest.mark.parametrize("tau", [None, 5.4 * STEP])
def test_slopes_are_those_of_finite_differences(tau: float | None) -> None:
    """Also carried through the past, with a dead time off the kinks between samples."""
    joined: tuple[str, ...] = () if tau is None else (LATE,)
    values = {**plain().plain_values, **TRUE} | ({} if tau is None else {TAU: tau})
    names = (*plain().prior(Configuration()).names, *([] if tau is None else [TAU]))
    exact = plain().simulate(joined, values, names).slopes["lower.y"]
    for i, name in enumerate(names):
        step = 1e-4 * abs(values.get(name) or 1.0)
        below, above = (
            plain().simulate(joined, {**values, name: values[name] + s}).shown["lower.y"]
            for s in (-step, step)
        )
        slope = (above - below) / (2 * step)
        within = (below < 9.9) & (above < 9.9)  # the sensor's range ends at 10 V
        error = np.linalg.norm((slope - exact[:, i])[within])
        assert error <= 1e-3 * np.linalg.norm(slope), name


@pytest.mark.parametrize("sharpness", [60.0, 1000.0])
def test_a_rim_is_seen_within_a_sample(sharpness: float) -> None:
    """A level that shoots over its rim within one step would come down as a flood."""
    builder, levels = tanks()[1], []
    balances = builder.balances((OVERFLOW,))
    values = dict(zip(builder.parameters.ids, builder.parameters.values, strict=True))
    values |= {**builder.parameters.constants, **TRUE, **RIM, f"{OVERFLOW}.k": sharpness}
    for parts in (1, 16):
        u = np.repeat(voltage(512, 3), parts)
        time = STEP / parts * np.arange(len(u))
        course = balances.run(time, u[:, None], np.array([True]), values)
        levels.append(course.shown[::parts, balances.outputs.index("shown:lower.y")])
    error = levels[0] - levels[1]
    assert float(np.sqrt(np.mean(error**2))) < 0.002
    assert float(np.abs(error).max()) < 0.02


def test_a_planted_overflow_is_fitted_to_its_truth() -> None:
    """What only a prior says stays uncertain: an unmeasured tank's levels could be larger."""
    place = bench(made(n=1024, seed=5, joined=(OVERFLOW,), more=RIM))
    ends, plain, found = joined_to(place, OVERFLOW, {**TRUE, **RIM})
    assert plain.noise["lower.y"].spread > 5 * NOISE
    assert found.noise["lower.y"].spread == pytest.approx(NOISE, rel=0.15)
    judged = replace(ends.judged, noise=found.noise)
    exact = Fitter(place, found.joined, fixed_values(found)).with_covariance(found, judged)
    model = model_of(place, exact, judged)
    width = {}
    for key in (f"{OVERFLOW}.l_o", f"{OVERFLOW}.f"):
        assert abs(found.values[key] - RIM[key]) < 4.0 * exact.u(key), key
        low, high = profile(model.line(key))
        assert low < RIM[key] < high
        width[key] = high - low
    assert width[f"{OVERFLOW}.l_o"] > 0.3 * RIM[f"{OVERFLOW}.l_o"]
    assert width[f"{OVERFLOW}.f"] < 0.1


def test_a_model_that_runs_away_is_no_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    """At its end, where errors of sensors are seen anew: it loses, and nothing fails."""
    place = bench(made(200))
    ends, plain = plain_end(place, {})
    candidate = place.candidates[0]

    def away(*_: object, **__: object) -> None:
        raise RanAway

    monkeypatch.setattr(Fitter, "finish", away)
    values = {u.id: (*u.starts, 1.0)[0] for u in candidate.unknowns}
    tried = ends.fitted((candidate,), {**plain.values, **values}, plain)
    assert (candidate,) == tried.joined
    assert ends.gain(tried, plain) < 0.0
    assert ends.polished(plain) is plain


@pytest.mark.parametrize("least", [0.0, -0.4])
def test_a_sensor_shows_what_the_recording_proves(least: float) -> None:
    recording = made(200)
    y = recording.values["lower.y"]
    own = bench(changed(recording, {"lower.y": y - y.min() + least}) if least else recording)
    said = own.simulate((), {**own.plain_values, "lower.y0": -8.0})  # its zero is far below
    assert float(np.asarray(said.shown["lower.y"]).min()) == pytest.approx(least)
