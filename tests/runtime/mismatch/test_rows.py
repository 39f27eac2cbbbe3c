"""Settled points, what they serve for, residuals as rows; a property of the fluid drives a law."""

import csv
import functools
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording
from scipy.stats import t

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.evidence.configuration import Configuration
from rulec.mismatch.evidence.limits import POINT_BUDGET
from rulec.mismatch.evidence.model import ESTIMATION, HELDOUT, PATTERN, SELECTION
from rulec.mismatch.evidence.steady.evidence import SteadyEvidence, span
from rulec.mismatch.evidence.steady.fit import fit
from rulec.mismatch.evidence.steady.model import TOO_MANY, UNSETTLED, evidence_of
from rulec.mismatch.evidence.steady.operating_state_means import averaged, likeness
from rulec.mismatch.evidence.steady.prepare import prepare
from rulec.mismatch.evidence.steady.rows import Rows, inverses
from rulec.mismatch.evidence.steady.screen import has_drivers, references, screen
from rulec.mismatch.evidence.steady.system import with_properties
from rulec.mismatch.experiment.forecast import SetPoints, data_at
from rulec.mismatch.experiment.plan import planned
from rulec.mismatch.experiment.result import inputs_csv
from rulec.mismatch.result import CandidateSet, Evidence
from rulec.simulation.equations import equations_of
from rulec.simulation.simulate import simulate_with
from tests.conftest import ROOT
from tests.runtime.mismatch.made import (
    DWELL,
    alone,
    changed,
    compared,
    loaded,
    prepared,
    recorded,
    rows_at,
    sampled,
    solved,
    tour,
    warming,
    without,
)

SAMPLES = 120


def errors(rows: Rows) -> Array:
    return rows.errors(rows.system.flows(Configuration()))[0]


def abc(samples: int, dwell: int) -> Recording:
    given = tour(loaded("abc")[0], samples, dwell=dwell)
    return recorded(loaded("abc"), given, moved=False)


def test_as_many_rows_of_unit_noise_as_estimates_less_free_flows() -> None:
    """Seven estimates of two free flows leave five rows; without a power reading, four."""
    made = abc(600, 60)
    rows = rows_at(loaded("abc"), made)
    (cell,) = rows.cells
    assert 5 == cell.rank
    assert np.ones(5) == pytest.approx(cell.table(errors(rows)).T.std(axis=0), rel=0.15)
    assert {"A.dp", "A.P_el", "B.dp", "B.P_el", "C.dp"} == set(cell.outputs)
    assert np.array_equal(rows.group_rank, rows.per_group(np.ones(len(rows))))
    assert np.array_equal(rows.group_point[rows.group], rows.point)
    fewer = rows_at(loaded("abc"), without(made, "A.P_el"))
    assert [4] == [c.rank for c in fewer.cells]
    assert "A.power" not in fewer.system.number


def test_a_pump_that_stands_leaves_the_rest_comparable() -> None:
    rules, builder = loaded("abc")
    values = solved(rules, builder, tour(rules, 240))
    stands = (np.arange(240) // 60) % 2 == 1
    still = {n: np.where(stands, 0.0, values[n]) for n in ("B.n", "B.P_el")}
    rows = rows_at(loaded("abc"), changed(sampled(values), still))
    system = rows.system
    sets = {frozenset(system.observers[i].id for i in c.observers): c for c in rows.cells}
    assert frozenset(o.id for o in system.observers) in sets
    for names, cell in sets.items():
        if names & {"B.pump", "B.power"}:
            assert not np.any(system.data.values["B.n"][cell.points] == 0.0)
    assert any("A.pump" in s and "B.pump" not in s for s in sets)


def cooling() -> tuple[tuple[Ruleset, ModelBuilder], Recording]:
    plant = loaded("cooling-loop")
    return plant, read_recording(ROOT / "plants/cooling-loop/examples/fouling.csv", plant[0])


def test_a_temperature_spans_its_range() -> None:
    """The entry says 5 % of the range; half of all offsets are below."""
    rows = rows_at(*cooling())
    assert span(rows.system, "HX.T_2") == pytest.approx(150.0)
    assert span(rows.system, "HX.T_1") < 20.0
    every = (c for c in rows.system.candidates if (c.name, c.place) == ("offset", "T_2"))
    (unknown,) = (candidate := next(every)).unknowns
    assert unknown.usual.of_place
    size = SteadyEvidence(rows).size(candidate, unknown)
    assert size.scale * t.ppf(0.75, size.freedom) == pytest.approx(0.05 * 150.0)


def test_estimates_of_infinite_noise_are_no_rows() -> None:
    """As where a speed is read in another unit while a reading of the other pump is lost."""
    plant, recording = cooling()
    lost = np.where(np.arange(len(recording)) < 240, recording.values["P1.dp"], np.nan)
    wrong = changed(recording, {"P1.dp": lost, "P2.n": 60.0 * recording.values["P2.n"]})
    rows = rows_at(plant, wrong)
    assert all(len(cell.points) for cell in rows.cells)
    assert np.isfinite(rows.errors(rows.system.flows(Configuration()))[0]).any()


def test_an_infinite_estimate_does_not_hide_the_flow_of_its_module() -> None:
    """A pump that stands, of which only two estimates are known: errors of form follow the flow."""
    where = loaded("abc")
    system = rows_at(where, recorded(where, tour(where[0], 240))).system
    flows = system.flows(Configuration())
    pump, power, plant = (system.number[f"B.{name}"] for name in ("pump", "power", "plant"))
    flows.values[pump] = np.nan
    before = likeness(system, flows, "B")
    flows.values[power, 5] = np.inf
    np.testing.assert_allclose(likeness(system, flows, "B"), before, atol=0.01)
    flows.values[[power, plant]] = np.nan
    assert np.abs(likeness(system, flows, "B") - before).max() > 0.1


def test_rows_vanish_on_simulated_readings_and_columns_are_their_derivatives() -> None:
    given = tour(loaded("abc")[0], SAMPLES, 0.8, 1.1)
    found = simulate_with(equations_of(loaded("abc")[0]), given, {})
    rows = rows_at(loaded("abc"), sampled({**given, **found.values}))
    assert float(np.abs(errors(rows)).max()) < 1e-3
    system, parameters = rows.system, loaded("abc")[1].parameters
    flows = system.flows(Configuration(), parameters.ids)
    maps = rows.maps(flows)
    for name in ("A.C2", "A.k2", "B.eta", "C.k2"):
        i = parameters.ids.index(name)
        step = 1e-3 * np.sqrt(parameters.covariance[i, i])
        moved = Configuration(values={name: float(parameters.values[i] + step)})
        expected = (rows.errors(system.flows(moved))[0] - errors(rows)) / step
        found = rows.column(maps, flows.by_value[name])
        size = float(np.abs(expected).max())
        assert expected / size == pytest.approx(found / size, abs=2e-3), name
    ones = np.ones(len(system.data))
    steep = rows.column(maps, {0: np.where(np.arange(len(ones)) == 3, np.inf, ones)})
    assert np.isfinite(steep).all()
    assert np.abs(steep).max() <= np.abs(rows.column(maps, {0: ones})).max()


LENGTH = 300


@pytest.fixture(scope="module")
def run() -> Recording:
    return recorded(alone(), tour(alone()[0], LENGTH))


def test_points_are_split_by_blocks(run: Recording) -> None:
    data = prepared(alone()[0], run)
    assert np.all(np.diff(data.block) >= 0)
    parts = [set(data.part[data.block == b].tolist()) for b in np.unique(data.block)]
    assert [{PATTERN[b % len(PATTERN)]} for b in range(len(parts))] == parts
    assert np.ptp(np.bincount(data.block)) <= 1
    assert np.array_equal(data.open, data.part != HELDOUT)
    assert not data.of_rows
    counts = [int((data.part == p).sum()) for p in (ESTIMATION, SELECTION, HELDOUT)]
    expected = "{} for estimation, {} for selection, {} held out (every fifth block)"
    assert expected.format(*counts) in data.split
    assert data.split.startswith(f"{len(data)} settled points in 25 blocks of time")
    speed, plateaus = data.values["A.n"], tour(alone()[0], LENGTH)["A.n"][::DWELL]
    nearest = np.abs(speed[:, None] - plateaus).min(axis=1)
    assert nearest.max() < 0.01 * speed.min()


def test_asked_spans_are_held_out_and_nothing_else(run: Recording) -> None:
    data = prepared(alone()[0], run, (60.0, 90.0), (200.0, 220.0))
    inside = ((data.time >= 60) & (data.time <= 90)) | ((data.time >= 200) & (data.time <= 220))
    assert np.array_equal(inside, data.part == HELDOUT)
    for block in np.unique(data.block):
        assert 1 == len(set(data.part[data.block == block].tolist()))
    assert {ESTIMATION, SELECTION, HELDOUT} == set(data.part.tolist())
    assert "held out (as asked)" in data.split
    first, again = (prepared(alone()[0], run).digest for _ in range(2))
    assert first == again != data.digest


def test_long_recordings_are_averaged(run: Recording) -> None:
    rules, _ = alone()
    held = {"A.n": np.repeat(tour(rules, 25 * DWELL)["A.n"][::DWELL], 800)}
    data = prepared(rules, recorded(alone(), held))
    assert len(data) * len(rules.observers) <= 1.5 * POINT_BUDGET
    single = prepared(rules, run).noise["A.dp"]
    assert np.median(data.noise["A.dp"]) < 0.75 * np.median(single)


def test_the_noise_of_an_input_shows_on_a_coarse_display_too() -> None:
    """Most samples show the same number, so differences of neighbours are mostly 0."""
    plant, samples, dwell, rpm = loaded("abc"), 240, 24, 1.0 / 60.0
    speeds = tour(plant[0], samples, dwell=dwell)
    run, draw = recorded(plant, speeds, moved=False), np.random.default_rng(5)
    shown = {n: rpm * np.round(v / rpm + draw.normal(0.0, 0.3, samples)) for n, v in speeds.items()}
    means = averaged(rows_at(plant, changed(run, shown)).system, np.zeros(0))
    for name, true in speeds.items():
        off = means.values[name] - true[means.time.astype(int)]
        assert np.sqrt(np.mean((off / means.noise[name]) ** 2)) < 1.5


@pytest.mark.parametrize(("speeds", "noise"), [((0.6, 1.25), 0.0), ((1.0, 1.06), 0.2)])
def test_means_are_rounded_as_their_samples_are(speeds: tuple[float, float], noise: float) -> None:
    """A display with steps beyond the noise shows one number during a state, or two in turns; it
    may show few numbers in all."""
    plant, samples, step = loaded("abc"), 240, 0.05e5
    run = recorded(plant, tour(plant[0], samples, *speeds, dwell=12), seed=None)
    names, draw = ("A.dp", "B.dp"), np.random.default_rng(3)
    shown = {
        name: step * np.round(run.values[name] / step + draw.normal(0.0, noise, samples))
        for name in names
    }
    means = averaged(rows_at(plant, changed(run, shown)).system, np.zeros(0))
    for name in names:
        off = means.values[name] - run.values[name][means.time.astype(int)]
        assert np.sqrt(np.mean((off / means.noise[name]) ** 2)) < 1.5


def test_a_table_of_points_has_a_point_per_row(run: Recording) -> None:
    rows = np.arange(DWELL // 2, LENGTH, DWELL)
    data = prepared(alone()[0], sampled({name: v[rows] for name, v in run.values.items()}))
    assert data.of_rows
    assert len(rows) == len(data)
    for name, noise in data.noise.items():
        assert 0.3 * data.points.systematic[name] == pytest.approx(noise), name


def test_gaps_and_lost_readings_are_left_out(run: Recording) -> None:
    lost = (run.time >= 100) & (run.time < 130)
    values = {n: np.where(lost, np.nan, v) for n, v in run.values.items()}
    late = replace(run, time=np.where(run.time >= 200, run.time + 5000.0, run.time), values=values)
    data = prepared(alone()[0], late)
    usable = np.isfinite(data.values["A.dp"])
    assert not np.any((data.time[usable] > 101) & (data.time[usable] < 129))
    assert not np.any((data.time > 200) & (data.time < 5200))
    assert np.any(data.time > 5200)


def test_nothing_settled_cannot_be_judged(run: Recording) -> None:
    short = sampled({n: v[:2] for n, v in run.values.items()})
    assert prepare(short, alone()[0]) is None
    found = compared(alone(), short)
    assert "cannot judge" == found.verdict
    assert "Cannot judge: 0 settled points; at least 12 are needed." == found.headline
    assert "Record settled operation" in found.next
    assert found.fit is None


def counted(recording: Recording) -> tuple[Evidence, ...]:
    rows = rows_at(alone(), recording)
    return evidence_of(recording, rows.system.data, rows)


def rows(evidence: tuple[Evidence, ...], because: str) -> int:
    return sum(e.rows for e in evidence if because in e.because)


def test_every_row_is_counted_once() -> None:
    """Also those of a pump that stands, which vanished in silence, and those spared."""
    rules, _ = alone()
    recording = recorded(alone(), tour(rules, LENGTH))
    evidence = counted(recording)
    assert LENGTH == sum(e.rows for e in evidence)
    assert rows(evidence, UNSETTLED) > 0
    assert all(e.used != (e.because == UNSETTLED) for e in evidence)
    least = rules.signal_by_id["A.n"].minimum
    slow = recording.values["A.n"].copy()
    slow[100:150] = 0.5 * least
    evidence = counted(changed(recording, {"A.n": slow}))
    assert LENGTH == sum(e.rows for e in evidence)
    assert rows(evidence, "A.n is below") >= 40
    assert not any(e.used for e in evidence if "A.n is below" in e.because)
    data = prepared(rules, recording)
    spared = replace(data, sample=np.where(data.sample > 3, -2, data.sample))
    evidence = evidence_of(recording, spared)
    assert rows(evidence, TOO_MANY) == int((spared.sample == -2).sum()) > 0
    assert (Evidence(LENGTH, False, UNSETTLED),) == evidence_of(recording, None)


def test_rows_that_cannot_be_read_are_counted(tmp_path: Path) -> None:
    rules, _ = alone()
    names = [s for s in rules.signals if s.id in rules.read]
    head = ",".join(["time [s]", *(f"{s.id} [{s.unit}]" for s in names)])
    cells = ",".join("1" for _ in names)
    times = ["0", "1", "1", "", *(str(i) for i in range(2, 20))]
    lines = [head, *(f"{t},{cells}" for t in times), "20"]
    file = tmp_path / "some.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    evidence = evidence_of(read_recording(file, rules), None)
    assert len(lines) - 1 == sum(e.rows for e in evidence)
    assert 1 == rows(evidence, "no usable time") == rows(evidence, "repeat the time")


def test_units_do_not_make_a_system_singular() -> None:
    """Slopes by pressures (Pa) and powers (W), 1e-10 and 1e-6 m3/s of each, side by side."""
    draw = np.random.default_rng(2)
    units = np.where(np.arange(12) % 2, 1e-10, 1e-6)
    plain = np.eye(12) + 0.1 * draw.standard_normal((5, 12, 12))
    truth = draw.standard_normal((5, 12, 1)) / units[:, None]
    solution = inverses(plain * units) @ (plain * units @ truth)
    assert solution == pytest.approx(truth, rel=1e-9)
    matrices = np.array([[[1.0, 1.0], [2.0, 2.0]], [[np.nan, 0.0], [0.0, 1.0]], np.eye(2)])
    solution = inverses(matrices) @ np.ones((3, 2, 1))
    assert np.isnan(solution[:2]).all()
    assert [1.0, 1.0] == solution[2].ravel().tolist()


SLIP = "A.slip-viscosity@Q_geo(dp, viscosity(T))"
VISCOSITY = "viscosity(A.T)"
COUNT = 240


@functools.cache
def oily() -> tuple[Ruleset, ModelBuilder]:
    return open_builder(Path(__file__).parent / "oily.yaml")


@functools.cache
def recording() -> Recording:
    """Slip in inverse proportion to the viscosity, which nobody reads."""
    rules, builder = oily()
    given = {**tour(rules, COUNT), "A.T": warming(COUNT)}
    usual = float(np.median(builder.fluid_drivers[VISCOSITY].at(given["A.T"])[0]))
    return recorded(oily(), given, {SLIP: {"m": 1.0, "mu0": usual}})


@functools.cache
def planted() -> Rows:
    return rows_at(oily(), recording())


def viscosity(celsius: float) -> float:
    """Of HLP 32 by Walther's equation in its own form, Pa s. Source: ASTM D341."""
    points = np.array([[313.15, 32.0], [373.15, 5.4]])
    double = np.log10(np.log10(points[:, 1] + 0.7))
    slope = (double[1] - double[0]) / np.log10(points[1, 0] / points[0, 0])
    there = double[0] + slope * np.log10((celsius + 273.15) / points[0, 0])
    density = 872.0 * (1.0 - 7.0e-4 * (celsius - 15.0))
    return float(density * (10 ** (10**there) - 0.7) * 1e-6)


def test_a_property_counts_as_a_reading() -> None:
    """Its noise is that of the thermometer; oil below freezing is beyond its equations."""
    given = {**tour(oily()[0], COUNT), "A.T": warming(COUNT) - 40.0}
    assert VISCOSITY not in rows_at(oily(), recorded(oily(), given)).system.data.values
    data = planted().system.data
    celsius = data.values["A.T"] - 273.15
    expected = [viscosity(t) for t in celsius]
    assert data.values[VISCOSITY] == pytest.approx(expected, rel=1e-9)
    steep = [(viscosity(t - 0.01) - viscosity(t + 0.01)) / 0.02 for t in celsius]
    assert data.noise[VISCOSITY] == pytest.approx(steep * data.noise["A.T"], rel=1e-4)


def standing(name: str, strength: str, value: float) -> CandidateSet:
    """One law, as if a mismatch had left it standing."""
    system = planted().system
    candidate = next(c for c in system.candidates if c.id == name)
    fixed, values = dict(references(system, candidate)), {f"{name}.{strength}": value}
    own: Any = {"joined": (name,), "values": values, "fixed": fixed, "periods": (), "terms": ()}
    return CandidateSet(names=(name,), titles=(name,), probability=0.5, **own)


def test_an_experiment_knows_the_property_where_the_temperature_is_set() -> None:
    """The recipe asks for the temperature, as nobody can set a viscosity."""
    laws = standing(SLIP, "m", 1.0), standing("A.slip-temperature@Q_geo", "b", 0.03)
    found = planned(recording(), *oily(), laws, most=2, seconds=3600.0)
    assert found.steps
    header, *rows = csv.reader(inputs_csv(found, oily()[0]).splitlines())
    assert all(row[header.index("A.T [degC]")] for row in rows)
    assert not any(VISCOSITY in name for name in header)
    data, celsius = planted().system.data, np.array([12.0, 47.0])
    time = data.time[-1] + np.array([1.0, 2.0])
    places = SetPoints({"A.T": celsius + 273.15}, np.array([0, 0]), time)
    there = with_properties(oily()[1], data_at(data, places))
    assert there.values[VISCOSITY] == pytest.approx([viscosity(t) for t in celsius], rel=1e-9)


def test_the_planted_law_is_among_the_best_and_fits_better_than_a_temperature() -> None:
    rows = planted()
    plain = fit(rows, Configuration(), rows.system.data.open)
    trials = {t.candidate.id: t for t in screen(plain, rows.system.candidates)}
    assert SLIP in list(trials)[:3]
    fits = {}
    for name in (SLIP, "A.slip-temperature@Q_geo"):
        found = trials[name]
        there = plain.setting.joining(found.candidate, found.values, found.fixed)
        fits[name] = fit(rows, there, plain.used)
    left = {name: float(np.sum(f.residual**2)) for name, f in fits.items()}
    assert min(left, key=lambda name: left[name]) == SLIP
    exponent = fits[SLIP].setting.values[f"{SLIP}.m"]
    assert abs(exponent - 1.0) < 4.0 * fits[SLIP].u(f"{SLIP}.m")


def test_of_a_property_that_is_read_the_reading_counts(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "plants" / "esp-pump", tmp_path / "plant")
    file = tmp_path / "plant" / "p100.yaml"
    file.write_text(f"{file.read_text()}fluid: glycerol\nkb: {ROOT / 'kb'}\n")
    loaded = open_builder(file)
    given = {**tour(loaded[0], COUNT), "pump.T": warming(COUNT)}
    given["pump.mu"] = viscosity(40.0) * (1.0 + np.arange(COUNT) / COUNT)
    recording = recorded(loaded, given, seed=None)
    for shown, driver in (
        (recording, "pump.mu"),
        (without(recording, "pump.mu"), "viscosity(pump.T)"),
    ):
        system = rows_at(loaded, shown).system
        every = [c for c in system.candidates if c.name == "head-viscosity"]
        every = [c for c in every if has_drivers(system, c)]
        assert [c.drivers["mu"] for c in every] == [driver]
