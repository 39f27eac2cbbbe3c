"""The truth simulator of tanks obeys its physics, and is independent of what it tests; its hard
cases have form errors, noise with a memory, drifts, any start, few set values."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Dynamics
from rulec_runtime.simulation.balances import Balances

from rulec.passes.pipeline import compile_plant
from rulec.prove.truth.kinds import difficulties
from rulec.prove.truth.smooth import SIZE_OF_FORM
from rulec.prove.truth.tanks.balance import Course, integrate
from rulec.prove.truth.tanks.build import METER_SLOPE, Setup, build, recorded_input
from rulec.prove.truth.tanks.detection_limit import noise_of
from rulec.prove.truth.tanks.plant import CASCADED, GRAVITY, LEVEL_ZERO, Layout, Plant, law
from rulec.prove.truth.tanks.rows import row, write_plant
from rulec.prove.truth.tanks.sensing import shown
from rulec.prove.truth.tanks.suite import HARD, cases
from tests.tank_row import ROW, SI, by_the_tool, parameters, volumes, without_errors

LAYOUTS = {layout.name: layout for layout in (CASCADED, ROW)}

TWO = Layout("two", "pump", ("upper", "lower"), ("lower",), False, 4.0, "u [V]", {})
PLAIN = (
    Plant(TWO, {})
    .with_("pump", gain=4.0)
    .with_("upper", area=15.0, outlet=0.1, start=8.0)
    .with_("lower", area=14.0, outlet=0.12, start=3.0)
    .with_("lower.y", gain=0.5)
)

EVERYTHING: dict[str, dict[str, float]] = {
    "upper": {
        **{"growth": 0.4, "body": 4.0, "body_height": 6.0, "cone": 0.02, "laminar": 0.2},
        **{"drowned": 4.0, "rim": 9.0, "weir": 8.0, "caught": 0.4, "seepage": 0.3},
        **{"leak": 0.01, "leak_begin": 333.3, "side": 0.02, "side_height": 3.0, "link": 0.01},
        **{"vortex": 10.0, "vortex_share": 0.2, "vortex_period": 50.0, "closing": 1e-4},
    },
    "lower": {
        **{"power": 0.7, "power_level": 5.0, "height": 0.5, "rim": 8.0, "weir": 20.0},
        **{"clog": 0.2, "clog_begin": 505.0},
    },
    "pump": {
        **{"dead_band": 0.1, "limit": 5.0, "droop": 0.02, "lag": 7.0, "delay": 9.0},
        **{"bypass": 9.0, "bypass_share": 0.3, "lift": 0.5, "lift_level": 0.05, "held": 0.01},
        **{"roll": 0.03, "kink": 2.0, "steeper": 0.3, "exponent": 0.2, "usual": 3.0},
        **{"decline": 1e-4, "warming": 0.2, "warming_time": 200.0},
        **{"play": 0.3, "rate": 0.2, "pocket": 0.4},
    },
}
"""Almost all effects of tanks and feed at once."""


def everything() -> Plant:
    plant = PLAIN
    for part, numbers in EVERYTHING.items():
        plant = plant.with_(part, **numbers)
    return plant


def flows(level: float, below: float = 0.0, **numbers: Any) -> dict[str, float]:
    """What the laws of the upper tank give, with some other numbers."""
    flow = law("flows", PLAIN.with_("upper", **numbers).parts["upper"])
    return dict(zip(("left", "over", "away"), flow(level, below, 0.0, 0.0), strict=False))


def constant(plant: Plant, voltage: float, samples: int = 150) -> Course:
    """A plant left alone with one input."""
    return integrate(plant, 4.0 * np.arange(float(samples)), np.full(samples, voltage))


def fed(voltages: list[float], **feed: Any) -> Course:
    """The plain plant with another feed, a voltage each 4 s."""
    plant = PLAIN.with_("pump", **feed)
    return integrate(plant, 4.0 * np.arange(float(len(voltages))), np.array(voltages))


@pytest.mark.parametrize("plant", [PLAIN, everything()], ids=["plain", "all effects"])
def test_volume_is_conserved(plant: Plant) -> None:
    random = np.random.default_rng(1)
    course = integrate(plant, 4.0 * np.arange(300.0), np.repeat(random.uniform(0.0, 6.0, 30), 10))
    stored = sum(volumes(t, course.levels[:, i]) for i, t in enumerate(plant.tanks.values()))
    assert course.pumped == pytest.approx(
        stored - stored[0] + course.drained + course.lost, abs=0.02
    )
    assert course.levels.min() > -1e-5


def test_outlets_obey_their_laws() -> None:
    """Loss linear plus quadratic; another exponent; counted from the outlet; held back; a rim;
    seepage."""
    laminar = flows(9.0, laminar=0.3)["left"]
    assert 0.3 * laminar + (laminar / 0.1) ** 2 / (2 * GRAVITY) == pytest.approx(9.0)
    ratio = flows(8.0, power=0.8, power_level=4.0)["left"] / flows(4.0)["left"]
    assert ratio == pytest.approx(2.0**0.8, rel=1e-4)
    for changed in ({"height": 2.0}, {"drowned": 5.0}):
        assert flows(9.0, 7.0, **changed)["left"] == flows(7.0)["left"]
    assert flows(1.9, height=2.0)["left"] == 0.0
    assert flows(9.0, rim=5.0, weir=3.0)["over"] == pytest.approx(24.0)
    assert flows(9.0, seepage=1.0)["away"] == pytest.approx(1.0, rel=2e-3)


def test_a_sharp_rim_holds_the_level_a_notch_does_not() -> None:
    """The same flow runs over both."""
    sharp, broad = (
        constant(PLAIN.with_("upper", rim=5.0, weir=strength, caught=0.5), 4.0)
        for strength in (200.0, 2.0)
    )
    assert sharp.levels[-1, 0] == pytest.approx(5.1, abs=0.1)
    assert broad.levels[-1, 0] > 6.0
    over = 16.0 - sharp.left[-1, 0]
    assert sharp.fallen[-1, 1] == pytest.approx(16.0 - 0.5 * over, rel=1e-3)


def test_delay_shifts_the_flow_and_lag_smooths_it() -> None:
    """A step at 40 s, in a plant that ran before as at the first sample."""
    step = [1.0] * 10 + [3.0] * 30
    assert fed(step, delay=10.0).fed.tolist() == [4.0] * 13 + [12.0] * 27
    expected = 12.0 - 8.0 * np.exp(-4.0 * np.arange(30) / 10.0)
    assert fed(step, lag=10.0).fed[10:] == pytest.approx(expected, abs=1e-4)


def test_dead_time_shows_levels_between_samples() -> None:
    """6 s ago with samples each 4 s: the level of a finer run."""
    slow = PLAIN.with_("lower.y", dead_time=6.0)
    coarse = shown(slow, constant(slow, 3.0, 20))["lower"]
    fine = integrate(PLAIN, np.arange(77.0), np.full(77, 3.0)).levels[:, 1]
    assert coarse[2:] == pytest.approx(0.5 * fine[2:71:4], abs=1e-5)
    assert coarse[:2].tolist() == [1.5, 1.5]


def test_sensor_errors_come_in_their_order() -> None:
    """Play, steps and limit of a triangle; then the reading is stuck."""
    triangle = np.concatenate([np.linspace(0.0, 10.0, 11), np.linspace(9.0, 0.0, 10)])
    course = constant(PLAIN, 3.0, triangle.size)
    course = replace(course, sensed=triangle[:, None])

    def read(**errors: Any) -> list[float]:
        plant = PLAIN.with_("lower.y", **{"gain": 1.0, **errors})
        return list(shown(plant, course)["lower"].tolist())

    assert read(play=2.0)[9:14] == [8.0, 9.0, 9.0, 9.0, 8.0]
    assert read(step=4.0, limit=7.0)[5:9] == [4.0, 7.0, 7.0, 7.0]
    assert read(stuck=8.0, stuck_end=20.0)[:7] == [0.0, 1.0, 2.0, 2.0, 2.0, 5.0, 6.0]
    assert read(offset=0.5, slope=0.1, drift=0.25)[1] == pytest.approx(1.1 + 0.5 + 1.0)


@pytest.fixture(scope="module")
def dynamics(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Dynamics]:
    found = {}
    for name, layout in LAYOUTS.items():
        folder = write_plant(layout, tmp_path_factory.mktemp("plants") / name)
        dynamic = compile_plant(folder).dynamics
        assert dynamic is not None
        found[name] = dynamic
    return found


def simulated(dynamic: Dynamics, setup: Setup, pieces: int) -> dict[str, np.ndarray]:
    """The tool's model with the true parameters, its samples cut in pieces, read at samples."""
    values = dict(dynamic.values)
    for name, (value, unit) in parameters(setup).items():
        assert name in values
        values[name] = value * SI[unit]
    states = tuple(s.id for s in dynamic.states)
    outputs = tuple(f"shown:{name}" for name in dynamic.outputs)
    balances = Balances(dynamic.plan, states, dynamic.inputs, outputs)
    course = by_the_tool(balances, values, setup, pieces).shown[::pieces]
    return {name.partition(".")[0]: course[:, i] for i, name in enumerate(dynamic.outputs)}


@pytest.mark.parametrize("profile", ["steps", "multisine", "ramps", "start-stop"])
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=list(LAYOUTS))
def test_plain_plant_is_what_the_compiler_makes_of_it(
    layout: Layout, profile: str, dynamics: dict[str, Dynamics]
) -> None:
    """With true parameters and fine steps, all readings agree within a millivolt.

    With one step per sample they agree to less than the noise only: where a tank runs empty, the
    tool's integrator is off by up to 0.1 V for a sample.
    """
    setup = build(layout, 5, 400, profile)
    plant = without_errors(setup)
    true = shown(plant, integrate(plant, setup.time, setup.shown))
    fine = simulated(dynamics[layout.name], setup, 25)
    coarse = simulated(dynamics[layout.name], setup, 1)
    for tank, values in true.items():
        assert fine[tank] == pytest.approx(values, abs=1e-3)
        assert np.sqrt(np.mean((coarse[tank] - values) ** 2)) < 0.01


ALL = difficulties("tanks", "all")
METERED = next(r for r in map(row, range(20)) if r.metered)


def hard_setup(*difficulties: str, samples: int = 256, seed: int = 4) -> Setup:
    """The shipped plant with difficulties, at few set values."""
    return build(CASCADED, seed, samples, "few-values", difficulties)


def test_every_outlet_and_the_pump_are_off_by_their_form_errors() -> None:
    """By 0.5 to 2 %; a flow meter has no law."""
    setup = hard_setup("form")
    for tank in setup.plant.tanks.values():
        form = tank["form"]
        assert SIZE_OF_FORM[0] <= form.rms <= SIZE_OF_FORM[1]
        laws = (law("flows", {**tank, "form": f}) for f in (form, None))
        off, plain = (flow(9.0, 0.0, 0.0, 0.0)[0] for flow in laws)
        assert off / plain - 1.0 == pytest.approx(form.at(9.0), abs=1e-12)
    feed = setup.plant.feed
    off, plain = (law("supply", {**feed, "form": f})(4.0) for f in (feed["form"], None))
    assert off / plain - 1.0 == pytest.approx(feed["form"].at(4.0), abs=1e-12)
    assert build(METERED, 1, 40, "", ("form",)).plant.feed["form"] is None


def test_noise_has_the_memory_that_the_answer_states() -> None:
    """Of the reading of a level that stands still."""
    setup = hard_setup("coloured", samples=20)
    (sensor,) = setup.plant.sensors.values()
    many = 20000
    still = replace(setup.course, time=np.arange(many * 1.0))
    still = replace(still, sensed=np.full((many, 1), 9.0), fallen=np.zeros((many, 2)))
    readings = (shown(setup.plant, still, seed)["lower"] for seed in (1, None))
    error = np.subtract(*readings)
    assert np.corrcoef(error[1:], error[:-1])[0, 1] == pytest.approx(sensor["colour"], abs=0.04)
    assert error.std() == pytest.approx(noise_of(sensor), rel=0.05)
    assert setup.difficulties == {"coloured": {"lower": sensor["colour"]}}


def test_sensors_drift_within_their_class() -> None:
    for seed in range(8):
        setup = build(METERED, seed, 60, "", ("drift",))
        bare = setup.plant
        for tank in setup.plant.sensors:
            bare = bare.with_(f"{tank}.y", wander=None)
        course = integrate(bare, setup.time, setup.shown)
        for tank, sensor in setup.plant.sensors.items():
            off = shown(setup.plant, course)[tank] - shown(bare, course)[tank]
            assert np.abs(off + sensor["zero"]).max() <= 2.0 * LEVEL_ZERO + 1e-12
            assert np.ptp(off) > 0.0
        meter = recorded_input(setup, seed) / np.maximum(setup.shown, 1e-9) - 1.0
        running = setup.shown > 0.0
        assert np.abs(meter[running]).max() < (4.0 + 4.0 * 0.3) * METER_SLOPE


def test_few_values_are_set_again_and_again() -> None:
    given = hard_setup(samples=1024).shown
    values, visits = np.unique(given), np.count_nonzero(np.diff(given)) + 1
    assert 3 <= values.size <= 5
    assert visits > 2 * values.size


def test_tanks_begin_at_any_level() -> None:
    """Low and high, and no sensor begins where it cannot show."""
    setups = [hard_setup("starts", samples=10, seed=seed) for seed in range(30)]
    levels = np.array([[tank["start"] for tank in s.plant.tanks.values()] for s in setups])
    assert np.ptp(levels[:, 0]) > 15.0
    for plant in (s.plant for s in setups):
        assert plant.tanks["lower"]["start"] * plant.sensors["lower"]["gain"] <= 8.0 + 1e-9


def test_the_suite_draws_tanks_of_all_groups() -> None:
    """Clean ones plant nothing, and are as hard as the others."""
    for case in cases(2, dict.fromkeys(HARD, 2)):
        assert case.difficulties
        assert bool(case.effects) != case.group.endswith("-clean")
    (clean,) = cases(1, {"all-clean": 1}, 256)
    answer = clean.make().answer
    assert answer.verdict == "none"
    assert set(ALL) >= set(answer.difficulties) > {"form", "coloured"}
