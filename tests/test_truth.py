"""The truth obeys its physics in dosing plants, and is independent of what it tests."""

import ast
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from rulec.prove.truth.settled.rig import PUMPS
from rulec.prove.truth.units import RPM
from tests.conftest import ROOT
from tests.dosing import (
    NOISE_FREE,
    RIGS,
    TABLE_1,
    Operation,
    Plant,
    Recording,
    Run,
    Sensing,
    calibration_run,
    fault_replay,
    healthy_run,
    possible_faults,
    record,
    warm_run,
)
from tests.dosing.__main__ import main

TRUTH = ROOT / "rulec" / "prove" / "truth"
ABC = RIGS["abc"]
FIXED = Sensing(statistical=0.0)
LINE_STATIC, LINE_QUADRATIC, MIXER_QUADRATIC = 0.05, 5.2e-6, 3.5e-7  # bar, bar/(l/h)2


def constant(plant: Plant, degrees: Mapping[str, float] = MappingProxyType({})) -> Recording:
    """Noise-free recording of three samples, with the degrees of its faults."""
    run = healthy_run(plant, 3)
    faults = {name: np.full(3, degree) for name, degree in degrees.items()}
    return record(Run(plant, run.operation, faults), NOISE_FREE)


def line_loss(recording: Recording, module: str = "A") -> np.ndarray:
    """Loss of a module's line in the plant abc, bar."""
    return recording.readings[f"{module}.dp [bar]"] - recording.readings["C.dp [bar]"]


@pytest.mark.parametrize("rig", RIGS)
def test_continuity_holds_in_every_rig(rig: str) -> None:
    """The flow of each mixer is the sum over the modules upstream, with leaks and throttles."""
    plant = RIGS[rig]
    calibration = calibration_run(plant)
    leak = {f"{name}.leakage": np.full(300, 0.3) for name in plant.modules}
    truth = record(Run(plant, calibration.operation, leak), NOISE_FREE).truth
    for mixer in plant.rig.mixers:
        upstream = [f"{m}.Q [l/h]" for m in plant.modules if mixer in plant.rig.path(m)]
        assert sum(truth[m] for m in upstream) == pytest.approx(truth[f"{mixer}.Q [l/h]"])


def test_pressure_balance_in_series() -> None:
    """A pump sees its line and both mixers downstream; the module of M2 sees M2 only."""
    shown = constant(RIGS["mixing-rig"]).readings
    for module, mixers in (("A", ("M1", "M2")), ("E", ("M2",))):
        line = LINE_STATIC + LINE_QUADRATIC * shown[f"{module}.Q [l/h]"] ** 2
        expected = line + sum(shown[f"{mixer}.dp [bar]"] for mixer in mixers)
        assert expected == pytest.approx(shown[f"{module}.dp [bar]"], rel=1e-10)


def test_operating_point_near_the_published_parameters() -> None:
    """Progressive cavity pump at 900 rpm: about 519 l/h, 1.78 bar, 149 W (method.md, 5)."""
    shown = constant(ABC).readings
    assert 519.0 == pytest.approx(shown["A.Q [l/h]"][0], abs=1.0)
    assert 1.78 == pytest.approx(shown["A.dp [bar]"][0], abs=0.05)
    assert 149.0 == pytest.approx(shown["A.P_el [W]"][0], abs=1.0)


@pytest.mark.parametrize("rig", ["abc", "abc-membrane", "abc-centrifugal"])
def test_pump_laws_hold_at_the_solution(rig: str) -> None:
    """The pump laws, written out in trade units, give flow and power at the solved pressure."""
    shown = {name: value[0] for name, value in constant(RIGS[rig]).readings.items()}
    n, dp, flow = shown["A.n [rpm]"], shown["A.dp [bar]"], shown["A.Q [l/h]"]
    large = flow / 0.15
    match rig:
        case "abc":
            law, power = 0.6 * n - 6 - 0.01 * n - 2 * dp**2, 25 + 0.095 * n + n * dp / 42
        case "abc-membrane":
            law, power = 3 * n - 2 - 0.02 * n - 6 * dp, 20 + 0.25 * n + n * dp * 5 / 39
        case _:
            law, power = flow, 0.15 * (188.3 + 0.03228 * large - 1.268e-6 * large**2)
            assert 1.111 - 1.713e-5 * large - 6.84e-9 * large**2 == pytest.approx(dp)
    assert law == pytest.approx(flow, rel=1e-10)
    assert power == pytest.approx(shown["A.P_el [W]"], rel=1e-10)


def test_affinity_scaling() -> None:
    """At half speed and flow the pressure is a quarter, and the power is an eighth."""
    pump, own = PUMPS["centrifugal"], {n: v for n, (v, _) in PUMPS["centrifugal"].numbers.items()}
    speed, flow = np.array([40.0, 20.0]), np.array([1e-4, 5e-5])
    pressure = pump.head(own, speed, flow)
    power = pump.power(own, speed, pressure, flow)
    assert (0.25, 0.125) == pytest.approx((pressure[1] / pressure[0], power[1] / power[0]))


@pytest.mark.parametrize("rig", ["abc", "abc-membrane", "abc-centrifugal"])
@pytest.mark.parametrize("degree", [0.05, 0.2, 0.8])
def test_leakage_removes_its_share_of_the_pump_flow(rig: str, degree: float) -> None:
    plant = RIGS[rig]
    leaking = constant(plant, {"A.leakage": degree})
    pump_flow = leaking.truth["A.Q_pump [l/h]"]
    assert (1 - degree) * pump_flow == pytest.approx(leaking.readings["A.Q [l/h]"], rel=1e-12)
    assert np.all(pump_flow > constant(plant).truth["A.Q_pump [l/h]"])


@pytest.mark.parametrize(("kind", "sign"), [("clogging", 1), ("widening", -1)])
def test_clogging_and_widening_change_the_loss_at_the_same_flow(kind: str, sign: int) -> None:
    """The friction part changes by the degree, the static part does not."""
    faulty = constant(ABC, {f"A.{kind}": 0.4, f"C.{kind}": 0.3})
    flow_a = faulty.readings["A.Q [l/h]"]
    line = LINE_STATIC + (1 + sign * 0.4) * LINE_QUADRATIC * flow_a**2
    assert line == pytest.approx(line_loss(faulty), rel=1e-10)
    mixer = (1 + sign * 0.3) * MIXER_QUADRATIC * faulty.truth["C.Q [l/h]"] ** 2
    assert mixer == pytest.approx(faulty.readings["C.dp [bar]"], rel=1e-10)


def test_sensor_faults_change_their_reading_only() -> None:
    healthy, faulty = (constant(ABC, x) for x in ({}, {"A.dp.high": 0.2, "B.P_el.low": 0.1}))
    scale = {"A.dp [bar]": 1.2, "B.P_el [W]": 0.9}
    for name, reading in healthy.readings.items():
        assert scale.get(name, 1.0) * reading == pytest.approx(faulty.readings[name], rel=1e-12)


def test_statistical_and_systematic_parts() -> None:
    """One systematic offset per sensor and recording; new scatter in each sample."""
    run = healthy_run(ABC, 2000)
    true = record(run, NOISE_FREE).readings["A.P_el [W]"]
    both, fixed, scatter = (
        record(run, sensing, seed=7).readings["A.P_el [W]"] - true
        for sensing in (TABLE_1, FIXED, Sensing(systematic=False))
    )
    assert 0.0 == pytest.approx(np.ptp(fixed), abs=1e-9)
    assert 0.3 * 5.0 == pytest.approx(scatter.std(), rel=0.05)
    assert fixed + scatter == pytest.approx(both, abs=1e-9)


@pytest.mark.parametrize(
    ("law", "spread", "largest"),
    [("normal", 1.0, np.inf), ("truncated", 0.880, 2.0), ("uniform", 2 / np.sqrt(3), 2.0)],
)
def test_laws_of_systematic_errors(law: str, spread: float, largest: float) -> None:
    """Spread in units of half the bound; drawn inside the bounds, none is beyond them. A sensor
    that reads higher than with another seed does so under every law."""

    def drawn(sensing: Sensing, seeds: int) -> list[float]:
        run, names = healthy_run(ABC, 1), ("A.P_el [W]", "B.P_el [W]")
        true = record(run, NOISE_FREE).readings
        shown = (record(run, sensing, seed).readings for seed in range(seeds))
        return [one[name][0] - true[name][0] for one in shown for name in names]

    found = drawn(replace(FIXED, law=law), 400)
    assert 5.0 * spread == pytest.approx(np.std(found), rel=0.05)
    assert np.abs(found).max() <= 5.0 * largest
    assert np.argsort(found[:20]).tolist() == np.argsort(drawn(FIXED, 10)).tolist()


@pytest.mark.parametrize("rig", RIGS)
def test_calibration_varies_pressure_apart_from_speed(rig: str) -> None:
    """Mixers read only when fitted."""
    plant = RIGS[rig]
    shown = record(calibration_run(plant), NOISE_FREE).readings
    for module in plant.modules:
        bench = shown[f"{module}.dp [bar]"][:150:10].reshape(3, 5)
        assert np.all(np.diff(bench, axis=0) > 0.01)  # the sensor's bound
    for mixer in plant.rig.mixers:
        reading = shown[f"{mixer}.dp [bar]"]
        assert ([150, 0], True) == (
            [int(np.isnan(part).sum()) for part in (reading[:150], reading[150:])],
            bool(np.nanmax(reading) < 2.0),
        )


def test_many_samples_at_once() -> None:
    plant, samples = RIGS["mixing-rig"], 20_000
    ratio = np.linspace(0.85, 1.15, samples)
    speed = {name: module.speed * ratio for name, module in plant.modules.items()}
    recording = record(Run(plant, Operation(np.arange(float(samples)), speed)), NOISE_FREE)
    assert np.all(np.diff(recording.truth["M2.Q [l/h]"]) > 0)


def test_impossible_requests_are_refused() -> None:
    """A weak pump, an unknown fault, a degree out of range, a reading that is no number."""
    plant = RIGS["abc-centrifugal"]
    slow = {"A": np.full(3, 300 * RPM), "B": np.full(3, 900 * RPM)}
    with pytest.raises(ValueError, match="no operating point"):
        record(Run(plant, Operation(np.arange(3.0), slow)))
    with pytest.raises(ValueError, match=r"no fault 'C\.leakage'"):
        constant(ABC, {"C.leakage": 0.1})
    with pytest.raises(ValueError, match=r"'A\.widening' needs 3 degrees"):
        constant(ABC, {"A.widening": 1.0})
    with pytest.raises(ValueError, match="no operating point"):
        record(Run(plant, Operation(np.arange(3.0), slow | {"A": np.full(3, np.nan)})))


def test_every_fault_can_be_replayed() -> None:
    names = possible_faults(ABC)
    for name in names:
        assert 80 == record(fault_replay(ABC, name)).truth[f"{name} [1]"].size
    assert {"A.leakage", "C.clogging", "B.P_el.low", "C.dp.high"} <= set(names)


def test_warm_liquid_raises_the_slip_of_one_pump() -> None:
    """3 % per kelvin of what the pressure drives, and nothing in the other module."""
    warm = warm_run(ABC, "A")
    recording = record(warm, NOISE_FREE)
    slip = {}
    for module in "AB":
        pressure, speed = (recording.readings[f"{module}.{s}"] for s in ("dp [bar]", "n [rpm]"))
        plain = 0.6 * speed - (6.0 + 0.010 * speed)  # l/h: 10 ml/rev less the slip at no pressure
        slip[module] = (plain - recording.truth[f"{module}.Q_pump [l/h]"]) / (2.0 * pressure**2)
    kelvin = recording.readings["A.T [degC]"] - 20.0
    assert (0.0, 30.0) == pytest.approx((kelvin.min(), kelvin.max()), abs=1e-2)
    assert slip["A"] == pytest.approx(np.exp(0.03 * kelvin))
    assert slip["B"] == pytest.approx(1.0)


MADE_OTHERWISE = {"abc": ("leakage_A.parquet", "step_B.csv")}
"""Recordings in another format, or made by another command."""


@pytest.mark.parametrize("name", ["abc", "mixing-rig"])
def test_shipped_examples_are_those_the_command_makes(name: str, tmp_path: Path) -> None:
    """`examples` reproduces the files of a plant's examples, byte for byte, but for those named."""
    main(["examples", "--plant", name, "-o", str(tmp_path)])
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    files = (path for path in (ROOT / "plants" / name / "examples").iterdir() if path.is_file())
    shipped = {path.name: path.read_bytes() for path in files}
    assert set(MADE_OTHERWISE.get(name, ())) == shipped.keys() - made.keys()
    assert made == {n: content for n, content in shipped.items() if n in made}
    assert 100_000 > max(len(content) for content in made.values())


def test_shares_no_code_with_what_it_tests() -> None:
    """No source of the simulator imports the tool; of tanks YAML is the table of effects alone."""
    for path in (*TRUTH.rglob("*.py"), *(ROOT / "tests" / "dosing").glob("*.py")):
        is_plain = path.parent.name == "tanks" and path.stem != "effect"
        foreign = {"rulec", "rulec_runtime", *(("yaml",) if is_plain else ())}
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names = [name for name in names if not name.startswith("rulec.prove.truth.")]
            assert not {name.partition(".")[0] for name in names} & foreign, path
