"""Diagnosis against a data sheet: pumps of the waste-water station, simulated from the sheet.

The simulator here is independent of the compiler: it finds the flow by bisection and puts the
faults in where they act (head curve, power, flow through the impeller).
"""

import csv
from dataclasses import replace

import numpy as np
import pytest
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.diagnosis.diagnose import diagnose
from rulec_runtime.diagnosis.steady.observe import observe, plan_inputs
from rulec_runtime.diagnosis.steady.points import points_of_samples
from rulec_runtime.recordings.recording import Recording
from rulec_runtime.recordings.stationary import find_stretches, noise_at_work

from tests.conftest import ROOT, compiled, plain_yaml, recordings_folder

SAMPLES = 40
SHEETS = {
    "grundfos-s3-145": ("pump_curve_large_743rpm_50Hz.csv", 1250.0),
    "grundfos-s3-120": ("pump_curve_small_991rpm_50Hz.csv", 640.0),
}


@pytest.fixture
def station() -> Ruleset:
    """The waste-water pumping station."""
    return compiled("hsy-pumping")


def large_pump(
    frequency: float, level: float, head: float = 0.0, power: float = 0.0, back: float = 0.0
) -> tuple[float, float]:
    """Flow (m3/h) and electric power (kW) of the large pump with missing head, excess power and
    recirculation of these degrees."""
    speed = frequency / 50.0
    low, high = 0.0, 6000.0
    for _ in range(80):
        flow = (low + high) / 2
        inner = flow / (1.0 - back)
        curve = 42.637 * speed**2 - 4.355e-4 * speed * inner - 8.7658e-7 * inner**2
        enough = (1.0 - head) * curve > 30.0 - level + 2.5e-7 * flow**2
        low, high = (flow, high) if enough else (low, flow)
    drawn = speed**3 * 246.98 + speed**2 * 2.3052e-2 * inner
    drawn += speed * 9.9386e-6 * inner**2 - 2.0515e-9 * inner**3
    return flow, (1.0 + power) * drawn / 0.98


def recording(**faults: float) -> Recording:
    """Pump 1.4 runs with faults, all others stand; readings every 15 min with a little noise."""
    random = np.random.default_rng(11)
    flow, power = large_pump(49.4, 2.0, **faults)
    values = {f"P{p}.{s}": np.zeros(SAMPLES) for p in (11, 12, 13, 21, 22, 23, 24) for s in "fQ"}
    values |= {name.replace(".Q", ".P_el"): np.zeros(SAMPLES) for name in values if ".Q" in name}
    noisy = 1.0 + 1e-3 * random.standard_normal((3, SAMPLES))
    values["P14.f"] = 49.4 + 0.0 * noisy[0]
    values["P14.Q"], values["P14.P_el"] = flow / 3600 * noisy[0], power * 1e3 * noisy[1]
    values["channel.l"] = 2.0 * noisy[2]
    time, segment = 900.0 * np.arange(SAMPLES), np.zeros(SAMPLES)
    return Recording(time=time, values=values, segment=segment, missing=(), notes=())


def test_only_what_leaves_the_tolerance_is_found(station: Ruleset) -> None:
    """By the sheet all samples are judged and sound; 7 % less head or 9 % more power is what grade
    3B allows. 20 % less head is named, by itself or with what looks the same at one operating
    point. Of 25 % more power a wrong reading cannot be told: both are named, half and half, with
    the right degree."""
    sound = diagnose(recording(), station)
    assert (SAMPLES, "ok") == (sound.judged, sound.status)
    for allowed in (recording(head=0.07), recording(power=0.09)):
        assert () == diagnose(allowed, station).findings
    (finding,) = diagnose(recording(head=0.2), station).findings
    causes = {finding.fault.id, *(name for name, _ in finding.alternatives + finding.remote)}
    assert {"P14.missing-head", "P14.recirculation", "P14.Q.low"} == causes
    (finding,) = diagnose(recording(power=0.25), station).findings
    shares = {finding.fault.id: finding.probability, **dict(finding.alternatives)}
    assert {"P14.excess-power", "P14.P_el.high"} == set(shares)
    assert 0.5 == pytest.approx(shares["P14.excess-power"], abs=1e-6)
    assert 0.25 == pytest.approx(finding.degree, abs=0.003)


@pytest.mark.parametrize(("head", "power"), [(0.2, 0.0), (0.15, 0.15)])
def test_each_degree_has_a_residual_of_its_own(station: Ruleset, head: float, power: float) -> None:
    """Missing head and excess power at once: each is found as if the other were not there."""
    readings = recording(head=head, power=power)
    points = points_of_samples(readings, station, noise_at_work(readings, station))
    names = {
        "x:exact:P14.missing-head:P14.pump-flow": head,
        "x:exact:P14.excess-power:P14.power-flow": power,
    }
    out = station.plan.select(names).run(plan_inputs(points))
    for name, degree in names.items():
        assert degree == pytest.approx(float(np.mean(out[name])), abs=0.002)


def test_a_pump_that_mostly_stands_has_settled_stretches(station: Ruleset) -> None:
    """Its noise is that of the samples in which it runs."""
    short = recording()
    running = np.arange(SAMPLES) >= SAMPLES - 8
    values = {n: v * running if n.startswith("P14") else v for n, v in short.values.items()}
    rarely = replace(short, values=values)
    noise = noise_at_work(rarely, station)
    stretches = find_stretches(rarely, station, noise)
    judged = observe(station, points_of_samples(rarely, station, noise)).valid.any(axis=0)
    assert noise["P14.Q"] > 0.0
    assert (SAMPLES - 7, SAMPLES) == (stretches.first[-1], stretches.last[-1])
    assert running.tolist() == judged.tolist()


@pytest.mark.parametrize("kind", SHEETS)
def test_curves_are_fits_to_the_makers_points(kind: str) -> None:
    """Head: parabola, power: cubic, least squares over the points named in the module."""
    file, largest = SHEETS[kind]
    path = recordings_folder() / "hsy-wastewater-pumping" / file
    if not path.is_file():
        pytest.skip(f"no real recordings at {path} (set RULEC_RECORDINGS)")
    with path.open(encoding="utf-8") as sheet:
        rows = [r for r in csv.DictReader(sheet) if float(r["Q_lps"]) <= largest]
    flow = np.array([3.6 * float(r["Q_lps"]) for r in rows])
    module = plain_yaml(ROOT / "kb" / "modules" / f"{kind}.yaml")
    stated = {name: float(p["value"]) for name, p in module["parameters"].items()}
    for letter, title, signs in (("h", "H_m", (1, -1, -1)), ("p", "P1_kW", (1, 1, 1, -1))):
        values = np.array([float(r[title]) for r in rows])
        fitted = np.polyfit(flow, values, len(signs) - 1)
        own = [sign * stated[f"{letter}{k}"] for k, sign in enumerate(signs)]
        assert own == pytest.approx(fitted[::-1], rel=1e-4)
        off = values - np.polyval(fitted, flow)
        spread = np.sqrt(off @ off / (len(flow) - len(signs)))
        u = float(module["parameters"][f"{letter}0"]["u"])
        assert u == pytest.approx(spread, rel=0.02)
