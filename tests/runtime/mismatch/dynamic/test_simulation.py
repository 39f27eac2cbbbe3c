"""Tanks simulated: a recording as it is read, what errors say; exact slopes, delays, rims; fits."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.columns import coarse_step, glitches_in, runs_of_same
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.robust_statistics import autocorrelation_time
from rulec_runtime.recordings.standing_still import standing_still
from rulec_runtime.simulation.balances import RanAway
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.failing_sensors import failing
from rulec.mismatch.evidence.stores.fit import Fitter, plain_end, polished, refit
from rulec.mismatch.evidence.stores.model import model_of
from rulec.mismatch.evidence.stores.noise import (
    Noise,
    gain,
    innovations,
    noise_of,
    score_covariance,
)
from rulec.mismatch.evidence.stores.simulation_problem import Record, SimulationProblem, record_of
from rulec.mismatch.evidence.stores.starting_values import from_afar
from rulec.mismatch.inference.heldout_errors import confounded, profile
from rulec.mismatch.limits import BLOCKS, SAMPLE_BUDGET
from tests.runtime.mismatch.dynamic.problems import (
    NOISE,
    OVERFLOW,
    RIM,
    STEP,
    TRUE,
    joined_to,
    made,
    problem_of,
    tanks,
    voltage,
)
from tests.runtime.mismatch.made import changed, without

COURSE = 3.0 + np.sin(np.arange(600) / 40.0)
NOISY = np.round(COURSE + 0.02 * np.random.default_rng(1).standard_normal(600), 3)


def read(recording: Recording) -> Record:
    return record_of(recording, tanks()[0], tanks()[1].given)


def test_blocks_follow_from_the_inputs_alone() -> None:
    """What was stored at the first sample is a parameter that shows at the beginning alone."""
    recording = made()
    first = read(recording)
    other = read(changed(recording, {"lower.y": recording.values["pump.u"]}))
    assert first.digest == other.digest
    assert 0.15 < 1.0 - first.open.mean() < 0.25
    for shift in range(0, 200, 20):
        moved = {n: np.roll(v, shift) for n, v in recording.values.items()}
        record = read(replace(recording, values=moved))
        assert record.open[: len(record.time) // BLOCKS].all()


def test_long_recordings_keep_the_volume_that_was_pumped() -> None:
    recording = made(3 * SAMPLE_BUDGET)
    record = read(recording)
    assert len(record.time) <= SAMPLE_BUDGET
    kept = recording.values["pump.u"][: 3 * len(record.time)]
    assert record.inputs["pump.u"].mean() == pytest.approx(kept.mean(), rel=1e-12)


def test_what_is_missing() -> None:
    recording = made()
    for missing in ("pump.u", "lower.y"):
        assert record_of(without(recording, missing), tanks()[0], tanks()[1].given) is None
    holes = recording.values["pump.u"].copy()
    holes[100:103] = np.nan
    record = read(changed(recording, {"pump.u": holes}))
    assert [holes[99]] * 3 == record.inputs["pump.u"][100:103].tolist()


def test_a_sensor_that_drops_out_is_told() -> None:
    """Single readings that jump away and back, often; a step of the level is none."""
    recording = made()
    y = recording.values["lower.y"].copy()
    odd = np.arange(20, 500, 12)
    y[odd] -= 4.0
    (found,) = failing(replace(recording, values={"lower.y": y}), tanks()[0])
    assert ("lower.y.drop-outs", "sensor") == (found.id, found.sort)
    assert odd.tolist() == np.flatnonzero(glitches_in(y)).tolist()
    assert not list(failing(recording, tanks()[0]))
    assert not glitches_in(np.repeat([1.0, 5.0, 2.0], 50)).any()


def test_a_reading_that_loses_its_noise_is_stuck() -> None:
    """Not one that is often the same: noise of a third of a step, for 25 readings here; a smooth
    course that is rounded or clipped; a plateau on which noise is half a digit."""
    quiet = np.round(3.0 + 0.35 * np.random.default_rng(2).standard_normal(600))
    rest = np.round(np.minimum(COURSE, 3.4), 2)
    rest = np.concatenate([rest, np.full(100, rest[-1])])
    random = np.random.default_rng(4)
    loud, faint = random.normal(0.0, 3.0, 600), random.normal(0.0, 0.22, 600)
    plateau = np.round(np.concatenate([100.0 + loud, 120.0 + faint]))
    assert max(b - a for a, b in runs_of_same(plateau, 1)[0]) > 40
    for values in (NOISY, quiet, rest, np.minimum(NOISY, 3.4), plateau):
        assert standing_still(values) == []
    for behind in (215, 260):
        stuck = NOISY.copy()
        stuck[200:behind] = stuck[200]
        assert [(200, behind)] == standing_still(stuck)


def test_a_coarse_display_is_told_by_its_step() -> None:
    many = np.round(3.0 * NOISY / 0.1) * 0.1
    assert len(np.unique(many)) > 40
    assert coarse_step(np.round(NOISY / 0.4) * 0.4, 0.025) == pytest.approx(0.4)
    assert coarse_step(many, 0.01) == pytest.approx(0.1)
    assert coarse_step(NOISY, 0.025) == 0.0
    assert coarse_step(np.where(COURSE > 3.0, 1.0, 0.0), 0.025) == 0.0


N = 20_000
ALL = np.ones(N, dtype=bool)


@pytest.mark.parametrize(("rho", "expected"), [(0.0, 1.0), (0.9, 1.81 / 0.19)])
def test_memory_of_a_fading_error(rho: float, expected: float) -> None:
    """The sum of squared correlations of an AR(1) process is (1 + rho**2)/(1 - rho**2), also where
    blocks are held out, which are no zeros; that of white noise is 1 to the last digit."""
    error = lfilter([1.0], [1.0, -rho], np.random.default_rng(1).standard_normal(N))
    assert autocorrelation_time(error, ALL) == pytest.approx(expected, rel=0.2 if rho else 0.0)
    there = (np.arange(N) // 400) % 5 != 2
    assert autocorrelation_time(error, there) == pytest.approx(
        autocorrelation_time(error, ALL), rel=0.15
    )


def test_noise_of_an_error() -> None:
    """Of an exact prediction that of a reading without steps, as of a tank that is always empty:
    errors are divided by it."""
    all_, none = np.ones(100, dtype=bool), np.zeros(100)
    assert Noise(0.01, 1.0) == noise_of(none, all_, 0.01)
    assert noise_of(none, all_, 0.0).weight > 0.0
    assert gain(Noise(2.0, 50.0), Noise(1.0, 10.0), 1000) == pytest.approx(100 * np.log(2.0))


def test_noise_that_lasts_is_counted() -> None:
    """The doubt of a mean in noise of first order: (1 + r)/(1 - r) times that of white noise."""
    error = lfilter([1.0], [1.0, -0.8], np.random.default_rng(1).standard_normal(N))
    ratio = float(score_covariance(np.ones((N, 1)), error, ALL)[0, 0]) / N
    assert ratio == pytest.approx(1.8 / 0.2, rel=0.15)


@pytest.mark.parametrize("smoothness", [1.0, 3.0])
@pytest.mark.parametrize(("size", "lasts"), [(1e-3, 10.0), (50.0, 200.0)])
def test_a_settled_filter_is_the_whole_covariance(
    size: float, lasts: float, smoothness: float
) -> None:
    runs = [slice(0, 300), slice(300, 350)]
    readings = np.random.default_rng(1).standard_normal((350, 2)) * max(size, 1.0)
    own = innovations(size, lasts, smoothness)
    logs, found = 0.0, []
    for run in runs:
        gap = np.sqrt(smoothness) / lasts * np.arange(run.stop - run.start)
        alike = np.exp(-gap) * (1.0 + gap if smoothness > 1.0 else 1.0)
        lower = np.linalg.cholesky(size**2 * toeplitz(alike) + np.eye(len(gap)))
        found.append(np.linalg.solve(lower, readings[run]))
        logs += float(np.sum(np.log(np.diag(lower))))
    np.testing.assert_allclose(own.of(readings, runs), np.concatenate(found), atol=1e-4)
    assert own.logs(runs) == pytest.approx(logs, abs=1e-6)


LATE = "pump.transport-delay@pump"
TAU = f"{LATE}.tau"
FORGOTTEN = 150
"""Samples after which what began before the recording does not matter."""


@functools.cache
def plain() -> SimulationProblem:
    return problem_of(made())


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
    problem = problem_of(made(n=1024, seed=5, joined=(OVERFLOW,), more=RIM))
    plain, found = joined_to(problem, OVERFLOW, {**TRUE, **RIM})
    assert plain.noise["lower.y"].spread > 5 * NOISE
    assert found.noise["lower.y"].spread == pytest.approx(NOISE, rel=0.15)
    model = model_of(found)
    width = {}
    for key in (f"{OVERFLOW}.l_o", f"{OVERFLOW}.f"):
        assert abs(found.values[key] - RIM[key]) < 4.0 * found.u(key), key
        low, high = profile(model.line(key))
        assert low < RIM[key] < high
        width[key] = high - low
    assert width[f"{OVERFLOW}.l_o"] > 0.3 * RIM[f"{OVERFLOW}.l_o"]
    assert width[f"{OVERFLOW}.f"] < 0.1


def test_a_model_that_runs_away_is_no_explanation(monkeypatch: pytest.MonkeyPatch) -> None:
    """At its end, where errors of sensors are seen anew: it loses, and nothing fails."""
    problem = problem_of(made(200))
    plain = plain_end(problem, {})
    candidate = problem.candidates[0]

    def away(*_: object, **__: object) -> None:
        raise RanAway

    monkeypatch.setattr(Fitter, "finish", away)
    values = {u.id: (*u.starts, 1.0)[0] for u in candidate.unknowns}
    tried = refit(plain, (candidate,), {**plain.values, **values})
    assert (candidate,) == tried.joined
    assert tried.gain(plain) < 0.0
    assert polished(plain) is plain


def test_a_reading_that_never_moves_may_be_predicted_exactly() -> None:
    """A transmitter that holds its value within a wide band has no error at all."""
    still = changed(made(200), {"lower.y": np.full(200, 5.0)})
    problem = problem_of(still)
    held = problem.candidate("lower.sensor-hysteresis@y")
    begin = Configuration().joining(held, {u.id: 10.0 for u in held.unknowns}, {})
    assert np.isfinite(list(from_afar(problem, begin).values.values())).all()


def test_values_that_nothing_determines_correlate_at_most_fully() -> None:
    """Rounding errors may leave them a variance below 0."""
    covariance = np.array([[4.0, 3.0], [3.0, -1e-20]])
    (pair,) = confounded(("a", "b"), covariance, frozenset({"a"}))
    assert abs(pair.correlation) == 1.0


@pytest.mark.parametrize("least", [0.0, -0.4])
def test_a_sensor_shows_what_the_recording_proves(least: float) -> None:
    recording = made(200)
    y = recording.values["lower.y"]
    own = problem_of(changed(recording, {"lower.y": y - y.min() + least}) if least else recording)
    said = own.simulate((), {**own.plain_values, "lower.y0": -8.0})  # its zero is far below
    assert float(np.asarray(said.shown["lower.y"]).min()) == pytest.approx(least)
