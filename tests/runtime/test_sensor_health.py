"""Sensors that fail are told before physics; what is in mended readings is judged all the same."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import Diagnosis, diagnose
from rulec_runtime.diagnosis.sensors import headers
from rulec_runtime.diagnosis.sensors.dead import at_zero
from rulec_runtime.diagnosis.sensors.sensor_health import examine
from rulec_runtime.diagnosis.sensors.units import Mixup
from rulec_runtime.recordings.clock_set_back import in_order
from rulec_runtime.recordings.reading_unit import parse_unit
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.standing_still import last_digit, standing_still
from rulec_runtime.report.wording import treatment_of

import rulec
from rulec.passes.pipeline import compile_plant
from tests.conftest import compiled
from tests.dosing import INSIDE, RIGS, TABLE_1, operating_points, record, visiting_run
from tests.method.readings import built, recording, ruleset
from tests.runtime import tanks
from tests.runtime.mismatch.made import changed
from tests.runtime.sheets import sampled
from tests.written import write_columns, write_plant

PLANTS = ("abc", "mixing-rig", "three")


def logged(rules: Ruleset, columns: dict[str, Array]) -> Recording:
    """A recording with as many digits as a logger writes."""
    shown = {t: np.array([float(f"{v:.6g}") for v in c]) for t, c in columns.items()}
    return recording(rules, {t: c for t, c in shown.items() if np.isfinite(c).any()})


@cache
def recorded(name: str, seed: int = 5) -> Recording:
    run = visiting_run(rig := RIGS[name], operating_points(rig, 6), {}, dwell=25)
    return logged(ruleset(name), record(run, TABLE_1, seed).readings)


def constant(
    recording: Recording, ruleset: Ruleset, name: str, value: float | None, since: float = 0.0
) -> Recording:
    """A reading, SI, that stays the same behind a share of the recording; None: as it was."""
    column = recording.values[name].copy()
    first = round(since * len(column))
    column[first:] = column[first] if value is None else value
    return changed(recording, {name: column})


def below_zero(recording: Recording, ruleset: Ruleset, name: str) -> Recording:
    """A broken wire: 3.5 mA where 4 to 20 mA are the range."""
    signal = ruleset.signal_by_id[name]
    reading = signal.lowest - 0.5 / 16.0 * (signal.highest - signal.lowest)
    return changed(recording, {name: np.full(len(recording), reading)})


def headed(recording: Recording, ruleset: Ruleset, name: str, header: str, true: str) -> Recording:
    """Numbers in one unit below a header that names another."""
    wrong, right = (parse_unit(u, ruleset.units) for u in (header, true))
    values = recording.values[name] * wrong.factor / right.factor
    scales = {**recording.scales, name: (wrong.factor, 0.0)}
    return replace(changed(recording, {name: values}), scales=scales)


def swapped(recording: Recording, ruleset: Ruleset, one: str, other: str) -> Recording:
    return changed(recording, {one: recording.values[other], other: recording.values[one]})


def at_the_end(
    recording: Recording, ruleset: Ruleset, name: str, current: float, noise: float = 0.0
) -> Recording:
    """From half of it on the current in mA of a transmitter that has reached its end."""
    signal = ruleset.signal_by_id[name]
    reading = signal.lowest + (current - 4.0) / 16.0 * (signal.highest - signal.lowest)
    made = constant(recording, ruleset, name, reading, 0.5)
    values = made.values[name]
    size = noise / 16.0 * (signal.highest - signal.lowest) * (values == reading)
    return changed(
        made, {name: values + size * np.random.default_rng(0).standard_normal(len(values))}
    )


def times(made: Recording, ruleset: Ruleset, factor: float, *names: str) -> Recording:
    return changed(made, {name: factor * made.values[name] for name in names})


ALL = ("A.dp", "B.dp", "C.dp")

CASES: dict[str, tuple[Callable[..., Recording], tuple[Any, ...], tuple[str, ...], str]] = {
    "dead": (constant, ("A.dp", 0.0), ("A.dp.dead",), "F"),
    "dead after a while": (constant, ("A.dp", 0.0, 0.5), ("A.dp.dead",), "F"),
    "broken wire": (below_zero, ("A.dp",), ("A.dp.range",), "F"),
    "saturated": (at_the_end, ("A.dp", 20.0), ("A.dp.saturated",), "C"),
    "saturated, NE 43": (at_the_end, ("A.dp", 20.5), ("A.dp.saturated",), "C"),
    "saturated, with noise": (at_the_end, ("A.dp", 20.33, 0.04), ("A.dp.saturated",), "C"),
    "stuck": (constant, ("A.dp", None, 0.5), ("A.dp.stuck",), "F"),
    "power stuck from the first sample": (constant, ("A.P_el", None), ("A.P_el.stuck",), "F"),
    "given, frozen": (constant, ("A.n", None, 0.4), ("A.n.stuck",), "F"),
    "given, frozen from the first sample": (constant, ("A.n", None), ("A.n.stuck",), "F"),
    "bar under mbar": (headed, ("A.dp", "mbar", "bar"), ("A.dp.unit",), "C"),
    "mbar under bar": (headed, ("A.dp", "bar", "mbar"), ("A.dp.unit",), "C"),
    "psi under bar": (headed, ("A.dp", "bar", "psi"), ("A.dp.unit",), "C"),
    "kW under W": (headed, ("A.P_el", "W", "kW"), ("A.P_el.unit",), "C"),
    "all pressures in kPa": (times, (100.0, *ALL), tuple(f"{n}.unit" for n in ALL), "C"),
    "1/s under rpm": (headed, ("A.n", "rpm", "Hz"), ("A.n.unit",), "C"),
    "swapped pressures": (swapped, ("A.dp", "B.dp"), ("A.dp.swapped", "B.dp.swapped"), "C"),
    "swapped powers": (swapped, ("A.P_el", "B.P_el"), ("A.P_el.swapped", "B.P_el.swapped"), "C"),
    "swapped speeds": (swapped, ("A.n", "B.n"), ("A.n.swapped", "B.n.swapped"), "C"),
}


OF_EACH_KIND = ("dead", "broken wire", "given, frozen", "bar under mbar", "swapped powers")
"""Asked about on every plant; the rest on the others in `make prove`."""


@pytest.mark.parametrize(
    ("case", "name"),
    [
        pytest.param(
            case,
            name,
            marks=pytest.mark.prove if name != "abc" and case not in OF_EACH_KIND else (),
        )
        for case in CASES
        for name in PLANTS
    ],
)
def test_a_sensor_that_fails_is_told(case: str, name: str) -> None:
    bend, how, expected, letter = CASES[case]
    rules = ruleset(name)
    found = diagnose(bend(recorded(name), rules, *how), rules)
    assert set(expected) == {s.id for s in found.sensors}
    assert {letter} == {s.condition.status for s in found.sensors}
    assert letter == found.status
    assert len(found.sensors) == len(expected) or "saturated" not in case
    assert ((), ()) == (found.findings, found.unknown)
    assert all(s.signal in s.text and s.condition.action for s in found.sensors)


@pytest.mark.parametrize("name", PLANTS)
def test_a_sound_recording_has_sound_sensors(name: str) -> None:
    """Also where speeds are held to the last digit, step by step, as set values are."""
    sound, rules = recorded(name), ruleset(name)
    assert () == examine(sound, rules).findings
    for signal in rules.signals:
        if signal.is_input and signal.id in sound.values:
            held = np.repeat(sound.values[signal.id][::25], 25)[: len(sound)]
            sound = changed(sound, {signal.id: held})
    assert () == examine(sound, rules).findings


@pytest.mark.parametrize(
    ("name", "level"), [("cascaded-tanks", "lower.y"), ("wastewater-lab", "tank1.l")]
)
def test_levels_that_fail(name: str, level: str) -> None:
    ruleset, recording = compiled(name), tanks.made(name, 1)
    low = ruleset.signal_by_id[level].lowest
    for bent, expected in (
        (constant(recording, ruleset, level, low), "dead"),
        (below_zero(recording, ruleset, level), "range"),
        (constant(recording, ruleset, level, None, 0.5), "stuck"),
        (constant(recording, ruleset, level, None), "stuck"),
    ):
        found = examine(bent, ruleset)
        assert [f"{level}.{expected}"] == [f.id for f in found.findings]
        assert not np.isfinite(found.recording.values[level][-1])
    assert () == examine(recording, ruleset).findings


@pytest.mark.parametrize("length", [9, 45])
def test_a_voltage_set_in_steps_is_not_stuck(length: int) -> None:
    ruleset, recording = compiled("cascaded-tanks"), tanks.made("cascaded-tanks", 2)
    random = np.random.default_rng(3)
    levels = np.round(random.uniform(1.5, 3.2, len(recording)), 3)
    lengths = random.choice([2, 3, length], len(recording))
    held = np.repeat(levels, lengths)[: len(recording)]
    assert () == examine(changed(recording, {"pump.u": held}), ruleset).findings


def test_noise_tells_a_measured_input_from_a_set_one() -> None:
    random = np.random.default_rng(4)
    noisy = np.round(900.0 + 2.0 * random.standard_normal(200), 2)
    noisy[120:] = noisy[120]
    assert [(120, 200)] == standing_still(noisy, u=4.0)
    set_by_hand = np.round(900.0 + 200.0 * random.standard_normal(200), 2)
    set_by_hand[120:] = set_by_hand[120]
    assert [] == standing_still(set_by_hand, u=4.0)
    assert 0.1 == last_digit(1.8)


def test_a_clock_that_was_set_back_is_told() -> None:
    """The order of rows holds, times go on; blocks of rows in another order are sorted."""
    time = np.concatenate([np.arange(0.0, 100.0), np.arange(40.0, 90.0)])
    found = in_order(time)
    assert [(100.0, 60.0)] == [(s.time, s.seconds) for s in found.sets]
    assert np.arange(150.0).tolist() == found.time.tolist()
    late = np.concatenate([np.arange(50.0, 100.0), np.arange(0.0, 50.0)])
    assert (True, ()) == (in_order(late).order is not None, in_order(late).sets)
    two = np.arange(100.0)
    two[[40, 41]] = two[[41, 40]]
    assert (True, ()) == (in_order(two).order is not None, in_order(two).sets)


def test_a_small_part_of_a_range_is_no_zero_where_it_is_usual() -> None:
    """A mixer that loses 4 mbar under a sensor of 1 bar is alive; a pump's sensor at 4 mbar not."""
    signal = replace(ruleset("abc").signal_by_id["C.dp"], lowest=0.0, highest=1e5, offset=0.0)
    for usual, zero in ((0.5, True), (0.004, False)):
        shown = at_zero(replace(signal, reference=usual * 1e5), np.array([0.0, 400.0]))
        assert [True, zero] == shown.tolist()


LEAKAGE, DEGREE = "A.leakage", 0.4


@cache
def leaking(points: int = 6, dwell: int = 40) -> Recording:
    """Some operating points; the leakage begins behind a third of the samples."""
    run = visiting_run(built("abc"), operating_points(built("abc"), points), {}, 0, dwell)
    n = run.operation.time.size
    faulty = replace(run, faults={LEAKAGE: np.where(np.arange(n) < n // 3, 0.0, DEGREE)})
    return recording(ruleset("abc"), record(faulty, INSIDE, 1).readings)


MENDED: dict[str, tuple[Callable[..., Recording], tuple[Any, ...], tuple[str, ...]]] = {
    "A.dp and B.dp exchanged": (swapped, ("A.dp", "B.dp"), ("A.dp", "B.dp")),
    "A.dp in psi": (times, (14.5038, "A.dp"), ("A.dp",)),
    "A.dp, B.dp, C.dp in kPa": (times, (100.0, *ALL), ALL),
}


def leakage_of(found: Diagnosis) -> None:
    """One finding, the leakage with the degree that was set."""
    (finding,) = found.findings
    assert finding.fault.id == LEAKAGE
    assert finding.degree == pytest.approx(DEGREE, abs=0.02)
    assert not found.unknown


def mended(case: str) -> Diagnosis:
    bend, how, _ = MENDED[case]
    return diagnose(bend(leaking(), ruleset("abc"), *how), ruleset("abc"))


@pytest.mark.parametrize("case", MENDED)
def test_what_is_in_the_mended_reading_is_told(case: str) -> None:
    found = mended(case)
    assert MENDED[case][2] == tuple(s.signal for s in found.sensors)
    assert {f"judged with this corrected: {case}"} == {treatment_of(s) for s in found.sensors}
    assert found.status == "C"
    leakage_of(found)


@pytest.mark.parametrize(("speed", "dead"), [(1000.0, ["A.dp"]), (0.0, [])])
def test_a_pressure_without_noise_is_dead_while_its_pump_runs(
    speed: float, dead: list[str], tmp_path: Path
) -> None:
    """Also where nothing else gives the flow, and another given reading is not recorded."""
    noise = np.random.default_rng(1).normal(0.0, 0.1, 80) * (speed > 0.0)
    readings = sampled({"A.n": (speed + noise) / 60.0, "A.dp": np.zeros(80)})
    rules = compile_plant(write_plant(tmp_path, {"A": "dosing-pcp"}))
    other = replace(rules.signal_by_id["A.n"], id="A.other")
    found = diagnose(readings, replace(rules, signals=(other, *rules.signals)))
    assert dead == [f.signal for f in found.sensors if f.condition.name == "dead"]


@pytest.mark.parametrize(("points", "kind"), [(1, "stuck"), (6, "stuck"), (6, "range")], ids=str)
def test_a_leakage_beside_a_dead_pressure_of_its_module(points: int, kind: str) -> None:
    """Any pressure leaves the leakage over."""
    made, signal = leaking(points, 240 // points), ruleset("abc").signal_by_id["A.dp"]
    shown = made.values["A.dp"].copy()
    shown[30:] = shown[30]
    if kind == "range":
        shown[:] = 1.08 * signal.highest
    found = diagnose(changed(made, {"A.dp": shown}), ruleset("abc"))
    assert [f"A.dp.{kind}"] == [s.id for s in found.sensors]
    leakage_of(found)
    if kind == "stuck":
        (blind,) = found.not_judged
        assert "in part: A.dp: stuck at one value; cannot detect A.dp.high, A.dp.low" == blind.text


def test_no_other_unit_takes_a_reading_out_of_its_calibrated_range() -> None:
    """Read as l/min, a flow in m3/h would be 0.06 of what was calibrated; the other way round the
    reading comes back to it."""
    plain = compiled("abc")
    signal = plain.signal_by_id["A.Q"]
    usual = np.full(30, 300.0 * signal.factor)
    known = replace(signal, valid_from=0.5 * usual[0], valid_to=2.0 * usual[0])
    calibrated = replace(plain, signals=tuple(known if s.id == "A.Q" else s for s in plain.signals))

    def other(ruleset: Ruleset, recorded: float, factor: float) -> bool:
        found = {"A.Q": Mixup("m3/h", "l/min", factor, 0.0)}
        values = {"A.Q": recorded * usual}
        return headers._in_unit(ruleset, values, {"A.Q": 0.0}, found) is not None

    assert other(plain, 1.0, 0.06)
    assert not other(calibrated, 1.0, 0.06)
    assert other(calibrated, 0.06, 1.0 / 0.06)


TORQUE_PUMP = """
module: torque-pump
version: 1
title: Pump with torque
signals:
  n:
    {quantity: rotational speed, unit: rpm, sensor: converter-speed, input: true, minimum: 100,
    reference: 1450}
  dp:
    {quantity: pressure difference, unit: bar, sensor: piezoresistive, range: [0, 40], minimum: 0.2,
    reference: 20}
  M:  {quantity: torque, unit: Nm, sensor: torque-transducer, range: [0, 10], reference: 4}
parameters:
  V:  {value: 10, unit: ml/rev, u: 0.05, source: test}
  C:  {value: 1.5, unit: l/h/bar, u: 0.3, source: test}
  k:  {value: 5.34, unit: "1", u: 0.12, source: test}
  M0: {value: 0.2, unit: Nm, u: 0.05, source: test}
definitions:
  Q_law: {is: n*V - C*dp}
  M_law: {is: M0 + V*dp/k}
observers:
  pump:   {component: pump, Q: Q_law, source: test}
  torque: {component: pump, Q: Q_law*M/M_law, source: test}
faults: [leakage(pump), slope(dp), slope(M)]
"""


@pytest.mark.parametrize("fault", ["P.leakage", "P.M.high"])
def test_no_unit_is_blamed_for_a_fault_of_a_pump_that_stands_at_times(
    fault: str, tmp_path: Path
) -> None:
    """In another unit the pressure would need an error of its own slope that undoes the unit. What
    stands still speaks neither for a unit nor for a fault."""
    (tmp_path / "kb").mkdir()
    (tmp_path / "kb" / "torque-pump.yaml").write_text(TORQUE_PUMP, encoding="utf-8")
    loss = "{k2: {value: 5.0e-7, unit: bar/(l/h)**2, u: 5.0e-8, source: test}}"
    modules = {"P": "torque-pump", "C": f"static-mixer, parameters: {loss}"}
    place = write_plant(tmp_path, modules, "P -> C")
    step = np.repeat(np.arange(24), 20)
    runs = step % 4 != 3
    inputs = {
        "time [s]": np.arange(480.0),
        "P.n [rpm]": np.array([1450.0, 1200.0, 900.0])[step % 3] * runs,
        "P.dp [bar]": np.array([20.0, 12.0, 8.0])[step % 3] * runs,
    }
    file = write_columns(tmp_path / "inputs.csv", inputs)
    made = rulec.simulate(place, file, faults=[f"{fault}=0.3@240:480"], noise=2)
    found = rulec.diagnose(place, made.to_frame()).to_dict()
    assert "sensors" not in found
    assert [fault] == [one["fault"] for one in found["findings"]]
