"""Readings simulated from a ruleset alone, against the independent truth and against themselves."""

import functools
import shutil
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.recordings.stationary import systematic_u

from rulec.passes.pipeline import compile_plant
from rulec.simulation.equations import Equations, SimulationRefused, equations_of
from rulec.simulation.sensing import SensorErrors, sense
from rulec.simulation.simulate import simulate_with
from tests import dosing as truth
from tests.conftest import ROOT, compiled
from tests.method.readings import built, evaluate, ruleset, to_si
from tests.written import write_plant

PLANTS = ("abc", "abc-membrane", "abc-centrifugal", "mixing-rig")
DEGREES, SPEEDS = (
    part.ravel() for part in np.meshgrid([0.0, 0.05, 0.3, 0.6, 0.9], [0.95, 1.0, 1.1])
)
"""Every degree at every speed, as a factor of the nominal one."""


def true_readings(plant: str, faults: dict[str, Array], **speeds: Array) -> dict[str, Array]:
    """Readings at shares of the nominal speeds of modules."""
    shares = {name: speeds.get(name, SPEEDS) for name in built(plant).modules}
    speed = {name: share * built(plant).modules[name].speed for name, share in shares.items()}
    operation = truth.Operation(np.arange(float(len(shares["A"]))), speed)
    run = truth.Run(built(plant), operation, faults)
    return to_si(ruleset(plant), truth.record(run, truth.NOISE_FREE).readings)


@functools.cache
def equations(plant: str) -> Equations:
    return equations_of(ruleset(plant))


def furthest(plant: str, expected: dict[str, Array], faults: dict[str, Array]) -> float:
    given = {name: expected[name] for name in equations(plant).given}
    simulated = simulate_with(equations(plant), given, faults)
    assert [""] * len(simulated.solved) == [simulated.why(i) for i in range(len(simulated.solved))]
    assert simulated.solved.all()
    pairs = [(expected[name], values) for name, values in simulated.values.items()]
    return max(float(np.max(np.abs(ours / theirs - 1.0))) for theirs, ours in pairs)


@pytest.mark.parametrize("plant", PLANTS)
def test_every_fault_as_the_truth_has_it(plant: str) -> None:
    faults = [f.id for f in ruleset(plant).faults]
    assert set(faults) <= set(truth.possible_faults(built(plant)))
    for fault in faults:
        expected = true_readings(plant, {fault: DEGREES})
        assert furthest(plant, expected, {fault: DEGREES}) < 1e-8, fault


def test_flows_are_those_of_the_estimates_where_one_is_off_by_its_misfit() -> None:
    rules, random = ruleset("mixing-rig"), np.random.default_rng(7)
    given = {
        name: rules.signal_by_id[name].reference * random.uniform(0.9, 1.1, 20)
        for name in equations("mixing-rig").given
    }
    off = simulate_with(equations("mixing-rig"), given, {}, {"A.pump": 1e-6})
    out = evaluate(rules, off.values)
    for observer in rules.observers:
        more = 1e-6 * (observer.id == "A.pump")
        flow = out[f"q:{observer.id}"] + more
        assert off.flows[observer.module] == pytest.approx(flow, rel=1e-9), observer.id


def test_no_operating_point() -> None:
    """A pump too slow against the other one; one that loses everything. Far away there is one."""
    slow = true_readings("abc-centrifugal", {}, A=np.array([0.5]), B=np.array([0.3]))
    assert furthest("abc-centrifugal", slow, {}) < 1e-8
    rules = ruleset("abc-centrifugal")
    speeds = rules.signal_by_id["A.n"].reference * np.array([1.0, 0.3, 0.9])
    together = simulate_with(equations_of(rules), {"A.n": speeds}, {"B.clogging": 0.2})
    assert [True, False, True] == together.solved.tolist()
    assert "no operating point at B.clogging 0.2, A.n 795 rpm, B.n 900 rpm: " in together.why(1)
    assert np.isnan(together.values["A.dp"][1])
    alone = simulate_with(equations_of(rules), {"A.n": speeds[2:]}, {"B.clogging": 0.2})
    assert alone.values["A.dp"][0] == together.values["A.dp"][2]
    nothing_left = simulate_with(equations("abc"), {}, {"A.leakage": 1.0})
    assert [False] == nothing_left.solved.tolist()
    assert "A carries" in nothing_left.why(0)


def test_readings_that_nothing_determines_are_given() -> None:
    """Pressure and oil temperature of the ZeMA rig drive its power and flow."""
    rules = compiled("zema-hydraulic")
    assert ("main.dp", "main.T") == equations_of(rules).given
    assert ("main.P_el", "main.Q") == equations_of(rules).predicted
    pressures = np.array([100e5, 160e5])
    simulated = simulate_with(equations_of(rules), {"main.dp": pressures}, {"main.leakage": 0.1})
    assert pressures.tolist() == simulated.values["main.dp"].tolist()
    assert np.all(np.diff(simulated.values["main.P_el"]) > 0)


def test_parallel_branches_leave_one_reading_free(tmp_path: Path) -> None:
    """The line of A reads the loss of one branch; nothing ties the other one, so it is given."""
    types = {"A": "dosing-pcp", "C": "static-mixer", "D": "static-mixer", "T": "plain-pipe"}
    plant = write_plant(tmp_path, types, "A -> C, A -> D, C -> T, D -> T")
    split = equations_of(compile_plant(plant))
    assert ("A.n", "D.dp") == split.given
    assert ("A.dp", "A.P_el", "C.dp") == split.predicted


def test_over_determined_plant_is_refused(tmp_path: Path) -> None:
    """If the power is an input too, a speed and a power that do not fit have no flow."""
    shutil.copytree(ROOT / "kb", tmp_path / "kb")
    kind = tmp_path / "kb" / "modules" / "dosing-pcp.yaml"
    free = "sensor: converter-power, "
    kind.write_text(kind.read_text().replace(free, f"{free}input: true, "))
    power = ruleset("abc").signal_by_id["A.P_el"].reference
    pump = f"dosing-pcp, reference: {{P_el: {power!r}}}"
    types = {"A": pump, "B": pump, "C": "static-mixer"}
    fixed = compile_plant(write_plant(tmp_path, types, "A -> C, B -> C", kb="kb"))
    with pytest.raises(SimulationRefused, match=r"A\.pump, .*more equations than unknowns"):
        equations_of(fixed)


def test_a_reading_that_is_not_given_costs_its_own_part_alone() -> None:
    speeds = np.array([16.0, np.nan, 16.0])
    simulated = simulate_with(
        equations_of(ruleset("hsy-pumping")), {"P11.f": 49.0, "P12.f": speeds * 49 / 16}, {}
    )
    assert [True, False, True] == simulated.solved.tolist()
    assert "" == simulated.why(1)
    assert [True, False, True] == np.isfinite(simulated.values["P12.P_el"]).tolist()
    assert np.isfinite(simulated.values["P11.P_el"]).all()


def test_bad_arguments() -> None:
    with pytest.raises(SimulationRefused, match=r"^abc has no input 'A\.dp'; known: A\.n, B\.n"):
        simulate_with(equations("abc"), {"A.dp": 1e5}, {})
    with pytest.raises(SimulationRefused, match=r"^A\.n: not every value is a number"):
        simulate_with(equations("abc"), {"A.n": np.array([15.0, np.inf])}, {})


def test_sensor_errors_are_those_of_the_class() -> None:
    rules, true = ruleset("abc"), {"A.dp": np.full(5, 1.8e5)}
    standard = float(systematic_u(rules.signal_by_id["A.dp"], 1.8e5))

    def drawn(bounded: bool) -> Array:
        random, errors = np.random.default_rng(5), SensorErrors(0.0, bounded)
        shown = np.array([sense(rules, true, errors, random)["A.dp"] for _ in range(1000)])
        assert (shown == shown[:, :1]).all()
        return np.asarray((shown[:, 0] - 1.8e5) / standard)

    assert np.std(drawn(bounded=False)) == pytest.approx(1.0, abs=0.1)
    assert np.max(np.abs(drawn(bounded=True))) <= 2.0
    assert np.max(np.abs(drawn(bounded=False))) > 2.0
