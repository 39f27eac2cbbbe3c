"""From a recording to the answer: what was planted is told, where, and how large.

Recordings that ship with the project are by the independent truth in rulec/prove/truth; the
others are made from the plant's own equations with a candidate built in."""

import functools
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from rulec_runtime.contract.plan import Array
from rulec_runtime.contract.ruleset import Ruleset
from rulec_runtime.recordings.recording import Recording, read_recording

from rulec.effects.model_builder import ModelBuilder, open_builder
from rulec.mismatch.answer.json_form import mismatch_form
from rulec.mismatch.answer.story import finding_facts
from rulec.mismatch.answer.wording import VERDICTS
from rulec.mismatch.evidence.failing_sensors import impossible
from rulec.mismatch.inference.heldout_errors import MODELS
from rulec.mismatch.result import Mismatch
from tests.conftest import ROOT
from tests.runtime.mismatch.dynamic import problems
from tests.runtime.mismatch.made import (
    SLIP,
    USUAL,
    Built,
    alone,
    changed,
    columns,
    compared,
    loaded,
    recorded,
    tour,
    warmed,
    warming,
    without,
)
from tests.written import write_plant

LITRE_PER_HOUR_AND_BAR = 1e-3 / 3600 / 1e5


@dataclass(frozen=True)
class Case:
    """What is planted and must be said of it; `values` as shown."""

    built: Built
    verdict: str
    values: Mapping[str, float]


CASES = {
    "relief valve": Case(
        {"A.relief-valve@Q_geo": {"K": 150 * LITRE_PER_HOUR_AND_BAR, "p_open": 1.9e5}},
        "ambiguous",  # its pressure follows its speed, as incomplete filling would: 70 to 29 %
        {"K": 150.0, "p_open": 1.9},
    ),
    "zero that drifts": Case(
        {"A.zero-drift-temperature@dp": {"z": 400.0, "T0": USUAL}}, "sensor", {"z": 0.004}
    ),
    "warm": Case({SLIP: {"b": 0.1, "T0": USUAL}}, "named", {"b": 0.1}),
    "healthy": Case({}, "none", {}),
}


SHORT = ("zero that drifts", "warm", "healthy")
"""Cases of every run; what takes longer runs in `make prove`."""


def made(name: str) -> Recording:
    """Of the warm one some temperatures are lost; the healthy one has no power."""
    recording = warmed(CASES[name].built, 240 if name == "warm" else 200)
    if name == "healthy":
        return replace(without(recording, "A.P_el"), missing=("A.P_el",))
    lost = (np.random.default_rng(1).random(len(recording)) < 0.05) & (name == "warm")
    return changed(recording, {"A.T": np.where(lost, np.nan, recording.values["A.T"])})


@functools.cache
def answer(name: str) -> Mismatch:
    return compared(alone(), made(name))


@pytest.mark.parametrize("name", [pytest.param("relief valve", marks=pytest.mark.prove), *SHORT])
def test_what_was_planted_is_told_and_proved(name: str) -> None:
    case, found = CASES[name], answer(name)
    assert case.verdict == found.verdict
    assert list(case.built) == [f.id for f in found.findings]
    assert found.latent_input is None
    assert ("A.P_el is not in the recording" in found.notes) == (name == "healthy")
    for finding in found.findings:
        for parameter, true in case.values.items():
            estimate = finding.parameters[parameter]
            assert estimate.lower <= true <= estimate.upper
            assert estimate.lower <= estimate.value <= estimate.upper
            assert abs(estimate.value - true) < 0.2 * abs(true)
        assert all(rival.gain < finding.gain for rival in finding.rivals)
        assert {(finding.module, finding.place)} == {(p.module, p.place) for p in found.locations}
        heldout = found.fit.heldout
        assert heldout.repaired <= heldout.shipped
        # Beside the noise there are the systematic errors of the other sensors, which stay. No
        # plant file holds what a sensor does: the whole explanation does.
        assert (heldout.explained if found.left_out else heldout.repaired) < 1.5 * heldout.noise


@pytest.mark.parametrize("name", ["zero that drifts", "healthy"])
def test_the_proof_follows_from_the_table(name: str) -> None:
    found = answer(name)
    table, form = columns(found), mismatch_form(found, "x")
    held, time = table["heldout [1]"] == 1, table["time [s]"]
    for fit in found.fits:
        measured = table[f"{fit.signal} measured [{fit.unit}]"]
        for model in MODELS:
            error = (table[f"{fit.signal} {model} [{fit.unit}]"] - measured)[held]
            rms = np.sqrt(np.mean(error**2))
            assert pytest.approx(getattr(fit.heldout, model), rel=1e-4) == rms
    inside = [(time >= since) & (time <= until) for since, until in form["split"]["heldout"]]
    np.testing.assert_array_equal(held, np.any(inside, axis=0))
    assert form["fits"][0]["relation"] in {r.id for r in alone()[0].residuals}
    assert form["fits"][0]["simulated"] is True


def test_what_laws_may_be_off_by_gives_no_sure_name() -> None:
    """A third of the slip of the case above moves the pressure less than errors of laws do."""
    found = compared(alone(), warmed({SLIP: {"b": 0.03, "T0": USUAL}}, 200))
    (finding,) = found.findings
    assert ("ambiguous", SLIP) == (found.verdict, finding.id)
    assert finding.probability == pytest.approx(1.0 - finding.inexact, abs=0.02)
    said = [line for _, lines in finding_facts(finding) for line in lines]
    assert any("inaccuracy of the laws and sensors" in line for line in said)


@pytest.mark.prove
def test_the_leakage_example() -> None:
    file = ROOT / "plants" / "abc" / "examples" / "leakage_A.csv"
    found = compared(loaded("abc"), read_recording(file, loaded("abc")[0]))
    (finding,) = found.findings
    assert ("fault", "A.leakage") == (found.verdict, finding.id)
    assert all(rival.gain < finding.gain for rival in finding.rivals)
    assert [("A", finding.place)] == [(p.module, p.place) for p in found.locations]
    assert found.fit.heldout.repaired < 1.5 * found.fit.heldout.noise
    for start, x, p in zip((10, 30, 50), (0.2, 0.4, 0.6), finding.periods, strict=True):
        assert start <= p.since < p.until < start + 10
        assert abs(p.degree - x) < 3 * p.u


def test_a_plant_that_stands_at_one_point_is_healthy() -> None:
    rules, _ = loaded("abc")
    given = {s.id: np.full(100, s.reference) for s in rules.signals if s.is_input}
    assert "none" == compared(loaded("abc"), recorded(loaded("abc"), given, seed=8)).verdict


@pytest.mark.prove
def test_a_driver_that_is_not_recorded() -> None:
    """Of a single module, too, a slow course is no fault that comes and goes."""
    built = {SLIP: {"b": 0.1, "T0": USUAL}}
    found = {}
    for plant, n in ((loaded("abc"), 200), (alone(), 240)):
        given = {**tour(plant[0], n, 0.98, 1.02), "A.T": warming(n)}
        found[n] = compared(plant, without(recorded(plant, given, built), "A.T"))
        assert "fault" not in {f.sort for f in found[n].findings}
    assert "unnamed" == found[200].verdict
    hidden = found[200].latent_input
    assert ("A", "Q_geo") == (hidden.module, hidden.place)
    true = np.interp(hidden.time, np.arange(200.0), warming(200))
    assert abs(float(np.corrcoef(hidden.course, true)[0, 1])) > 0.9
    assert found[200].next.startswith("Record ")


def hostile(name: str, values: Mapping[str, Array]) -> dict[str, Array]:
    n, draw = len(values["A.n"]), np.random.default_rng(3)
    late = np.arange(n) > n // 2
    return {
        "holes": lambda: {k: np.where(draw.random(n) < 0.2, np.nan, v) for k, v in values.items()},
        "no reading": lambda: {"A.dp": np.full(n, np.nan)},
        "stuck": lambda: {"A.dp": np.where(late, values["A.dp"][n // 2], values["A.dp"])},
        "swapped": lambda: {"A.dp": values["A.P_el"], "A.P_el": values["A.dp"]},
        "zero": lambda: {k: np.zeros(n) for k in values},
        "huge": lambda: {"A.P_el": 1e12 * values["A.P_el"]},
        "negative": lambda: {k: -v for k, v in values.items()},
        "noise": lambda: {k: draw.normal(v.mean(), v.std(), n) for k, v in values.items()},
    }[name]()


LONG = [pytest.param(name, marks=pytest.mark.prove) for name in ("holes", "stuck", "huge")]
NONSENSE = ("no reading", "swapped", "zero", "negative")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", [*LONG, *NONSENSE, "noise"])
def test_hostile_recordings_get_an_answer(name: str) -> None:
    recording = warmed(CASES["warm"].built, 72)
    found = compared(alone(), changed(recording, hostile(name, recording.values)))
    json.dumps(mismatch_form(found, "plant"), allow_nan=False)
    assert found.verdict in VERDICTS
    if name in NONSENSE:
        assert "cannot judge" == found.verdict
        assert found.fit is None
        assert ("Look at A.dp" in found.next) == (name == "no reading")


def shifted(there: tuple[Ruleset, ModelBuilder], signal: str, by: float) -> Mismatch:
    given = {**tour(there[0], 144), "A.T": warming(144)}
    recording = recorded(there, given)
    return compared(there, changed(recording, {signal: recording.values[signal] + by}))


def test_power_that_no_law_says_has_no_tick() -> None:
    """Within its belief `P0` would have to be 44 W, sheet 25 +- 0.5: nobody believes that."""
    found = shifted(alone(), "A.P_el", 25.0)
    assert found.verdict not in ("none", "cannot judge")
    assert found.strain or found.findings
    assert "Nothing to do" not in found.next


def test_a_pressure_reading_with_a_zero_error_is_told_as_that(tmp_path: Path) -> None:
    """Of a pump by its sheet, with no line behind it."""
    plant = write_plant(tmp_path, {"A": "metered-centrifugal"})
    found = shifted(open_builder(plant), "A.dp", 0.15e5)
    assert [f.id for f in found.findings] == ["A.offset-pressure@dp"]
    assert not any("check valve" in f.title for f in found.findings)


def test_a_power_below_zero_is_a_sensor_that_is_wrong() -> None:
    """With swapped wires a power meter reads less than nothing: that was "no mismatch" once."""
    found = shifted(alone(), "A.P_el", -2000.0)
    (finding,) = found.findings
    assert "sensor" == found.verdict
    assert ("impossible-reading", "A", "P_el") == (finding.name, finding.module, finding.place)
    assert "144 of 144 readings lie outside of 0 to" in finding.text
    assert [("A", "P_el")] == [(p.module, p.place) for p in found.locations]


def test_most_readings_must_be_out_of_range() -> None:
    """A few are left out, like single readings that jump. Plants that store are asked too."""
    recording = recorded(alone(), tour(alone()[0], 120))
    for share, expected in ((0.0, 0), (0.4, 0), (0.6, 1)):
        off = np.where(np.arange(120) < share * 120, 2000.0, 0.0)
        wrong = changed(recording, {"A.P_el": recording.values["A.P_el"] - off})
        assert expected == len(list(impossible(wrong, alone()[0])))
    level = problems.made(200)
    assert not list(impossible(level, problems.tanks()[0]))
    high = changed(level, {"lower.y": np.full(200, 14.0)})
    assert ["lower.y.impossible-reading"] == [f.id for f in impossible(high, problems.tanks()[0])]
